"""The demo's photo: `python -m synth.demo_scene -o DIR` renders a glazed gourd under a soft
environment and two softboxes.

Writes `photo.png` (sRGB, 16 bits, with alpha: the photo) and `truth.exr` (the ground truth of its
decomposition).
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.io.atomic import new_folder, require_writable
from isc_core.io.exr import write_channels

from .capture.sensor import write_photo
from .capture.truth import GroundTruth, exposed, render_truth
from .rendering import RenderOptions
from .scene.camera import SMALLEST, Camera
from .scene.lights import EnvironmentLight, Light, panel_toward_origin
from .scene.materials import Material
from .scene.scene import Scene
from .shapes.gourd import gourd, gourd_albedo

SIZE, SAMPLES = 320, 64
_IN_VIEW = 2.3  # object units, the side of the picture
_FILES = ("truth.exr", "photo.png")
_LAYERS = ("image", "diffuse", "specular", "reflectance", "shading")


def demo_scene(size: int = SIZE) -> Scene:
    """Return the gourd, tipped toward the viewer, in a square picture.

    Parameters
    ----------
    size : int, optional
        Side of the picture in pixels.

    Returns
    -------
    Scene
        The gourd with its material, lights and camera.

    Raises
    ------
    InputError
        For an invalid size.
    """
    return Scene(
        gourd().turned(14),
        Material(gourd_albedo(), "ggx", gloss=0.1, strength=1.0, ior=1.5),
        demo_lights(),
        Camera(size, size, size / _IN_VIEW),
    )


def demo_lights() -> tuple[Light, ...]:
    """Return a soft environment, a warm softbox at the upper left, and a cool one to the right."""
    return (
        EnvironmentLight(0.55 * soft_environment()),
        panel_toward_origin((-5.0, 5.5, 7.0), (1.7, 1.7), (88.0, 80.0, 68.0)),
        panel_toward_origin((7.0, 1.5, 4.0), (0.8, 3.2), (16.0, 20.0, 27.0)),
    )


def demo_object(size: int = SIZE, samples: int = SAMPLES) -> GroundTruth:
    """Render the demo's object, exposed so that only its highlights reach 1.

    Parameters
    ----------
    size : int, optional
        Side of the picture in pixels.
    samples : int, optional
        Light paths per pixel.

    Returns
    -------
    GroundTruth
        The maps.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    scene = demo_scene(size)
    return exposed(
        scene, render_truth(scene, RenderOptions(samples=samples)), level=0.9, layer="image"
    )[1]


def soft_environment(rows: int = 64) -> np.ndarray:
    """Return an environment of low frequencies: sky, horizon, ground, and a window.

    Parameters
    ----------
    rows : int, optional
        Rows of the image.

    Returns
    -------
    (rows, 2 rows, 3) ndarray of float32
        Linear radiance, row 0 straight up.
    """
    polar = (np.arange(rows) + 0.5) * np.pi / rows
    turn = (np.arange(2 * rows) + 0.5) * np.pi / rows
    up = np.cos(polar)[:, None, None]
    sky, horizon, ground = (
        np.array([0.30, 0.42, 0.62]),
        np.array([0.62, 0.55, 0.46]),
        np.array([0.20, 0.15, 0.11]),
    )
    height = np.clip(up, 0, 1) ** 0.6
    below = np.clip(-up, 0, 1) ** 0.5
    gradient = np.where(
        up >= 0, horizon + (sky - horizon) * height, horizon + (ground - horizon) * below
    )
    window = np.exp(3 * (np.sin(polar)[:, None] * np.cos(turn - 0.5 * np.pi)[None] - 1))[
        ..., None
    ] * np.array([0.75, 0.55, 0.35])
    return np.ascontiguousarray(gradient + window, np.float32)


def write_truth(path: Path, truth: GroundTruth) -> None:
    """Write the ground truth as a multilayer EXR file, with the channel names of `maps.exr`.

    Parameters
    ----------
    path : Path
        The file.
    truth : GroundTruth
        The maps.
    """
    channels = {
        f"{name}.{c}": getattr(truth, name)[..., i] for name in _LAYERS for i, c in enumerate("RGB")
    }
    channels |= {f"normal.{c}": truth.normal[..., i] for i, c in enumerate("XYZ")}
    channels |= {"height.Z": truth.height, "mask.A": truth.mask.astype(np.float32)}
    write_channels(path, channels)


def main(arguments: list[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : list of str, optional
        Command-line arguments; those of the process by default.

    Returns
    -------
    int
        0, or 2 after a one-line error message.
    """
    parser = argparse.ArgumentParser(
        prog="python -m synth.demo_scene",
        description="Render a glossy object with its ground truth.",
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder for photo.png and truth.exr"
    )
    parser.add_argument(
        "--size", type=int, default=SIZE, help="side of the image in pixels (default: %(default)s)"
    )
    parser.add_argument(
        "--samples", type=int, default=SAMPLES, help="light paths per pixel (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    try:
        if options.size < SMALLEST or options.samples < 2:
            raise InputError(f"--size must be at least {SMALLEST} and --samples at least 2")
        require_writable(options.output, _FILES)
        truth = demo_object(options.size, options.samples)
        with new_folder(options.output, _FILES) as folder:
            write_truth(folder / "truth.exr", truth)
            write_photo(folder / "photo.png", truth)
    except InputError as error:
        print(f"synth: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
