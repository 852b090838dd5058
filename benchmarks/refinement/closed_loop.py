"""Render results in Cycles before and after the refinement of their gloss, and compare with the
photo.

  python -m benchmarks.refinement.closed_loop cup jug vase [--samples 128]

Each is a result folder of `isc decompose`. The scene is that of `isc-blender import` with the
fitted gloss and without the photo's specular image; PSNR in dB against the photo, white being its
99.8th percentile, clipped there: without gloss, the start, and the refined result. Folders with
nothing to refine, or whose start stays, are named and left out.

Limits: the noise of few samples counts as an error: 32 instead of 128 cost up to 2 dB.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.blender.renders import RenderVariant, render
from benchmarks.program import run_program
from blender_addon.files.result_arrays import read_result
from isc_core.evaluation.metrics import psnr
from isc_core.refinement import refine_gloss
from isc_core.result_files.result_folder import load, save
from isc_core.scene.decomposition import Decomposition

_WHITE = 99.8  # percentile
_GLOSSY = RenderVariant(gloss="lobe")


def closed_loop(d: Decomposition, folder: Path, samples: int, variant: RenderVariant) -> float:
    """Render a result under its own light and compare it with the photo.

    Parameters
    ----------
    d : Decomposition
        The result.
    folder : Path
        Where it is written; replaced.
    samples : int
        Samples per pixel.
    variant : RenderVariant
        What to show.

    Returns
    -------
    float
        PSNR in dB.
    """
    save(d, folder, arrays=True)
    found, _ = render(read_result(folder), variant, samples)
    white = float(np.percentile(d.image[d.mask], _WHITE))
    photo, seen = (np.minimum(layer / white, 1) for layer in (d.image, found))
    return psnr(photo, seen, d.mask)


def main() -> None:
    """Run the measurement."""
    parser = argparse.ArgumentParser(description="closed loop of refined gloss in Cycles")
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT")
    parser.add_argument("--samples", type=int, default=128)
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "result"
        for place in options.results:
            start = load(place)
            done = refine_gloss(start)
            if not done.kept:
                print(f"{place.name:12s} {'start stays' if done.lamps else 'nothing to fit'}")
                continue
            none, before, after = (
                closed_loop(d, folder, options.samples, variant)
                for d, variant in (
                    (start, RenderVariant()),
                    (start, _GLOSSY),
                    (done.result, _GLOSSY),
                )
            )
            rows.append((none, before, after))
            print(
                f"{place.name:12s} no gloss {none:.1f}  start {before:.1f}  refined {after:.1f}",
                flush=True,
            )
    if rows:
        none, before, after = np.array(rows).T
        print(
            f"{len(rows)} results, medians: over the start {np.median(after - before):+.1f} (least "
            f"{(after - before).min():+.1f}), over no gloss {np.median(after - none):+.1f} (least "
            f"{(after - none).min():+.1f})"
        )


if __name__ == "__main__":
    run_program(main)
