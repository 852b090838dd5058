"""Measure `isc refine` on rendered scenes.

  python -m benchmarks.refinement.measure -o FOLDER --first 100 --count 8 [--size 192]

Prints, for each scene, whether the new light was kept, and the errors of shading and reflectance
(mean square after one scale) over the start's; then their geometric means. A start that stays
counts as 1. FOLDER keeps what was rendered and decomposed.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from benchmarks.program import run_program
from isc_core.evaluation.metrics import geometric_mean, scaled_mse
from isc_core.scene.decomposition import Decomposition
from synth.refine.refine import RefineOptions, refine

from .scenes import SMOOTH, RefinementScene, scene_of

ERRORS = ("shading", "reflectance")


def errors_of(scene: RefinementScene, d: Decomposition) -> tuple[float, ...]:
    """Return the errors of a result of a scene.

    Parameters
    ----------
    scene : RefinementScene
    d : Decomposition

    Returns
    -------
    tuple of float
        By `ERRORS`.
    """
    mask = scene.truth["mask"]
    return tuple(scaled_mse(scene.truth[name][mask], getattr(d, name)[mask]) for name in ERRORS)


def main() -> None:
    """Run the measurement."""
    parser = argparse.ArgumentParser(description="measure isc refine on rendered scenes")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--size", type=int, default=192)
    parser.add_argument("--strictness", type=float, default=RefineOptions.strictness)
    options = parser.parse_args()
    rows: list[tuple[bool, np.ndarray]] = []
    for number in range(options.first, options.first + options.count):
        scene = scene_of(options.output, number, options.size)
        begun = time.perf_counter()
        done = refine(scene.start, RefineOptions(strictness=options.strictness))
        seconds = time.perf_counter() - begun
        ratio = np.divide(errors_of(scene, done.result), errors_of(scene, scene.start))
        rows.append((scene.light == SMOOTH, ratio))
        print(
            f"{number} {scene.light:12s} {'kept' if done.kept else 'start stays':12s} "
            f"objective {done.before:.2f} -> {done.after:.2f}  shading x{ratio[0]:.2f}  "
            f"reflectance x{ratio[1]:.2f}  {seconds:.0f} s",
            flush=True,
        )
    for title, smooth in (("lamps", False), ("smooth", True)):
        group = [ratio for is_smooth, ratio in rows if is_smooth == smooth]
        if group:
            means = [geometric_mean(values) for values in np.transpose(group)]
            print(f"{title} ({len(group)}): shading x{means[0]:.2f}, reflectance x{means[1]:.2f}")


if __name__ == "__main__":
    run_program(main)
