"""The demo's photo: `python -m synth.demo_scene -o DIR` renders a glazed gourd under a soft sky and two softboxes.

Writes `photo.png` (sRGB, 16 bits, with alpha: what a person would take) and `truth.exr` (what a decomposition should find).
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from isc_core.atomic import new_folder, require_writable
from isc_core.errors import InputError
from isc_core.exr import write_channels

from .gourd import gourd, painted_skin
from .ground_truth import GroundTruth, Material, View, render
from .lighting import soft_sky, softbox
from .variant import load_mitsuba

_FILES = ("truth.exr", "photo.png")
_LAYERS = ("image", "diffuse", "specular", "reflectance", "shading")


def demo_lights() -> dict[str, Any]:
    """The lights of the demo, as Mitsuba emitters. Raises `InputError` where Mitsuba is not installed."""
    mi = load_mitsuba()
    return {
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(soft_sky()), "scale": 0.55},
        "key": softbox(mi, (-5.0, 5.5, 7.0), (1.7, 1.7), (88.0, 80.0, 68.0)),
        "fill": softbox(mi, (7.0, 1.5, 4.0), (0.8, 3.2), (16.0, 20.0, 27.0)),
    }


def demo_object(view: View) -> GroundTruth:
    """Renders the demo's object, exposed so that only its highlights reach 1. Raises `InputError` where Mitsuba is not installed."""
    lights = demo_lights()
    truth = render(gourd().turned(14), Material(painted_skin()), lights, view)
    return exposed(truth)


def exposed(truth: GroundTruth, share: float = 0.995) -> GroundTruth:
    """The same scene with the light scaled so that `share` of the object's values stay below 0.9."""
    gain = 0.9 / max(float(np.quantile(truth.image[truth.mask], share)), 1e-6) if truth.mask.any() else 1.0
    lit = {name: getattr(truth, name) * np.float32(gain) for name in ("image", "diffuse", "specular", "shading")}
    return GroundTruth(**lit, reflectance=truth.reflectance, normal=truth.normal, height=truth.height, mask=truth.mask, alpha=truth.alpha)


def write_photo(path: Path, truth: GroundTruth) -> None:
    """Writes the image as a camera would: sRGB, clipped at 1, 16-bit PNG, the mask as alpha. Raises `InputError` if it cannot."""
    linear = np.clip(truth.image, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    pixels = np.dstack([encoded[..., ::-1], truth.mask])
    if not cv2.imwrite(str(path), np.rint(pixels * 65535).astype(np.uint16)):
        raise InputError(f"{path} cannot be written: choose a folder that you may write to")


def write_truth(path: Path, truth: GroundTruth) -> None:
    """Writes the ground truth as one multilayer EXR file, with the channel names of `maps.exr`."""
    channels = {f"{name}.{c}": getattr(truth, name)[..., i] for name in _LAYERS for i, c in enumerate("RGB")}
    channels |= {f"normal.{c}": truth.normal[..., i] for i, c in enumerate("XYZ")}
    channels |= {"height.Z": truth.height, "mask.A": truth.mask.astype(np.float32)}
    write_channels(path, channels)


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns 0, or 2 after one line about what was wrong."""
    parser = argparse.ArgumentParser(prog="python -m synth.demo_scene", description="Render a glossy object with its ground truth.")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for photo.png and truth.exr")
    parser.add_argument("--size", type=int, default=View.size, help="side of the image in pixels (default: %(default)s)")
    parser.add_argument("--samples", type=int, default=View.samples, help="rays per pixel (default: %(default)s)")
    options = parser.parse_args(arguments)
    try:
        if options.size < 8 or options.samples < 1:
            raise InputError("--size must be 8 or more and --samples 1 or more")
        require_writable(options.output, _FILES)
        truth = demo_object(View(size=options.size, samples=options.samples))
        with new_folder(options.output, _FILES) as folder:
            write_truth(folder / "truth.exr", truth)
            write_photo(folder / "photo.png", truth)
    except InputError as error:
        print(f"synth: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
