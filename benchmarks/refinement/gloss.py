"""Measure the refinement of gloss on rendered scenes, or on result folders of photos.

  python -m benchmarks.refinement.gloss -o FOLDER --first 100 --count 36 [--size 160] [--odds 0]
  python -m benchmarks.refinement.gloss --results cup jug vase

Prints, for each scene with a separated highlight, whether the new gloss was kept; the shares of the
held-out specular light that the start's lobe and the new one explain; and the PSNR in dB against
the photo (white: its 99.8th percentile) of the diffuse layer alone, with the start's lobe, and with
the new one. Of scenes also errors against the truth, of the start and of the new one: direction of
the brightest lamp in degrees, normals where highlights are, alpha over its truth, and the mean
square error of the specular layer under another light, over that of none. Then medians of what was
kept.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.program import run_program
from isc_core.lobe_fitting.specular_level import fitted_specular
from isc_core.refinement import GlossRefinement, refine_gloss
from isc_core.result_files.result_folder import load
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.brdf.ggx import F0
from isc_core.shading.lights import DirectionalLight
from isc_core.shading.lobe_rendering import Lobe, lobe_under

from .gloss_scenes import GlossScene, gloss_scene

_WHITE = 99.8  # percentile
_HIGHLIGHT = 0.2  # of the brightest separated light


def psnr(d: Decomposition, gloss: np.ndarray | float) -> float:
    """Return the PSNR of the diffuse layer with some gloss, against the photo.

    Parameters
    ----------
    d : Decomposition
    gloss : (H, W, 3) ndarray or 0

    Returns
    -------
    float
        dB.
    """
    white = float(np.percentile(d.image[d.mask], _WHITE))
    photo, found = (np.minimum(layer[d.mask] / white, 1) for layer in (d.image, d.diffuse + gloss))
    return float(-10 * np.log10(np.square(photo - found).mean() + 1e-12))


def against_photo(start: Decomposition, done: GlossRefinement) -> tuple[float, ...]:
    """Return the PSNR without gloss, with the start's lobe and with the result's.

    Parameters
    ----------
    start : Decomposition
    done : GlossRefinement

    Returns
    -------
    tuple of float
        Three.
    """
    lobes = [one.brdf.predicted for one in (start, done.result) if one.brdf is not None]
    return (psnr(start, 0.0), *(psnr(start, lobe) for lobe in lobes))


def errors_of(scene: GlossScene, d: Decomposition) -> tuple[float, ...]:
    """Return the errors of a result of a scene.

    Parameters
    ----------
    scene : GlossScene
    d : Decomposition

    Returns
    -------
    tuple of float
        Lamp, normals, alpha and new light, as above; NaN without a lamp.
    """
    truth, fit, mask = scene.truth, d.brdf, d.mask
    assert fit is not None and fit.alpha is not None and fit.direction is not None
    shown = scene.start.specular.mean(axis=2)
    bright = mask & (shown > _HIGHLIGHT * shown.max())
    turn = (d.normal[bright] * truth["normal"][bright]).sum(axis=1)
    lamp = max(truth["directions"] @ fit.direction, default=float("nan"))
    level = fitted_specular(d).specular or 0.0
    light = DirectionalLight(truth["new_direction"], np.full(3, np.pi * level))
    moved = lobe_under(Lobe(alpha=max(fit.alpha, 0.01), f0=F0), d.normal[mask], light)
    true = truth["new_specular"][mask]
    total = max(float(np.square(true).sum()), 1e-12)
    return (
        float(np.degrees(np.arccos(np.clip(lamp, -1, 1)))),
        float(np.degrees(np.arccos(np.clip(turn, -1, 1))).mean()),
        fit.alpha / float(truth["alpha"]),
        float(np.square(moved - true).sum()) / total,
    )


def measured(name: str, start: Decomposition) -> tuple[GlossRefinement, tuple[float, ...] | None]:
    """Refine a result and print a line; None where there is nothing to fit.

    Parameters
    ----------
    name : str
    start : Decomposition

    Returns
    -------
    done : GlossRefinement
    decibels : tuple of float or None
        Of `against_photo`.
    """
    begun = time.perf_counter()
    done = refine_gloss(start)
    seconds = time.perf_counter() - begun
    if not done.lamps:
        print(f"{name:12s} no highlights to fit", flush=True)
        return done, None
    none, before, after = against_photo(start, done)
    print(
        f"{name:12s} {'kept' if done.kept else 'start stays':12s} lamps {done.lamps}  "
        f"held out {done.before:.2f} -> {done.after:.2f}  "
        f"dB none {none:.1f} start {before:.1f} new {after:.1f}  {seconds:.0f} s",
        flush=True,
    )
    return done, (none, before, after)


def scenes(options: argparse.Namespace) -> None:
    """Measure rendered scenes and print medians.

    Parameters
    ----------
    options : argparse.Namespace
    """
    decibels, errors, matt, fitted = [], [], 0, 0
    for number in range(options.first, options.first + options.count):
        scene = gloss_scene(options.output, number, options.size, options.odds)
        done, found = measured(str(number), scene.start)
        fitted += found is not None
        if not done.kept or found is None:
            continue
        decibels.append(found)
        if not scene.truth["strength"]:
            matt += 1
            print("             kept on a matt object", flush=True)
            continue
        pair = (errors_of(scene, scene.start), errors_of(scene, done.result))
        errors.append(pair)
        names = ("lamp", "normals", "alpha", "new light")
        parts = [f"{n} {a:.2f} -> {b:.2f}" for n, a, b in zip(names, *pair, strict=True)]
        print("             " + "  ".join(parts), flush=True)
    print(f"kept {len(decibels)} of {fitted} with highlights to fit; on matt objects {matt}")
    if decibels:
        _print_medians(np.array(decibels))
    if errors:
        middle = np.nanmedian(np.array(errors), axis=0)
        print("medians, start", np.round(middle[0], 2), "new", np.round(middle[1], 2))


def _print_medians(decibels: np.ndarray) -> None:
    over_start, over_none = (decibels[:, 2] - decibels[:, k] for k in (1, 0))
    print(
        f"dB, medians: over the start's lobe {np.median(over_start):+.1f} (least "
        f"{over_start.min():+.1f}), over no gloss {np.median(over_none):+.1f} (least "
        f"{over_none.min():+.1f})"
    )


def results(folders: Sequence[Path]) -> None:
    """Measure result folders and print medians.

    Parameters
    ----------
    folders : sequence of Path
    """
    found = [measured(folder.name, load(folder)) for folder in folders]
    kept = [decibels for done, decibels in found if done.kept and decibels is not None]
    if kept:
        _print_medians(np.array(kept))


def main() -> None:
    """Run the measurement."""
    parser = argparse.ArgumentParser(description="measure the refinement of gloss")
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="where scenes are kept")
    parser.add_argument("--results", type=Path, nargs="+", metavar="RESULT")
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--count", type=int, default=36)
    parser.add_argument("--size", type=int, default=160)
    parser.add_argument("--odds", type=float, default=0.0)
    options = parser.parse_args()
    if options.results:
        results(options.results)
    elif options.output is not None:
        scenes(options)
    else:
        parser.error("give -o FOLDER for rendered scenes, or --results")


if __name__ == "__main__":
    run_program(main)
