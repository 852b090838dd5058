"""What do fewer evaluations cost? Photos as they are solved now, against a long solve.

  python -m benchmarks.sirfs.evaluations WORLD --panoramas DIR [--part validation|test] [--count N]
  [--photos DIR] [--seed K] [--side PIXELS] [--json FILE]

WORLD is a folder of `isc world build`. Held-out bodies are lit and photographed as for
`prediction_weights`, but larger, and solved with the object 256 pixels long, from the predicted
normals, shading and light: as photos are now, and as they were before (`LONG`: with a tolerance of
2e-4). Even photos are the validation set, on which settings were chosen; odd ones are the test set.
The table has errors and evaluations, now over before, as geometric means over photos with the 95 %
interval of resampled photos.

With `--photos`, a folder of masked photos, it says as well how far their normals move, as the
median over pixels, when the logarithm of the image changes by up to 1e-7.

Limits: shading has cast shadows, which SIRFS cannot explain.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.bootstrap import bootstrap_samples, interval
from isc_core.decomposition.models import DecompositionTask, Settings, SolveOptions, solve
from isc_core.errors import InputError
from isc_core.networks.scene_network import ScenePrediction, predict_scene
from isc_core.photo import Photo, read_photo
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    normal_from_reference,
    real_sh,
)
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.settings import PHOTO_PREDICTIONS, PredictionWeights, Start

from .prediction_weights import METRICS, Lit, estimated, lit_bodies, measured

LONG = PredictionWeights(0.5, 0.5, True, 1.0, (Start(dome=1, light=1),))
_PARTS = "validation", "test"  # in turn
_SIZE = 256  # of the object, as it is solved
_SUFFIXES = (".png", ".jpg", ".jpeg")


def compared(lit: Lit) -> list[list[float]]:
    """Solve a body now and before.

    Parameters
    ----------
    lit : Lit

    Returns
    -------
    list of list of float
        Now and before: the errors in the order of `METRICS`, and the evaluations.
    """
    seen, rows = predict_scene(lit.photo, lit.mask), list[list[float]]()
    for belief in (PHOTO_PREDICTIONS, LONG):
        way = f"{belief.normals}:{belief.shading}:{belief.light_temperature}"
        found = estimated(lit, seen, way, "photo", belief, _SIZE)
        normal = normal_from_reference(normals(found.height))
        errors = measured(lit, normal, real_sh(normal) @ light_from_reference(found.light))
        rows.append([*errors, float(found.diagnostics.evaluations or 0)])
    return rows


def moved(photo: Photo, belief: PredictionWeights, seed: int) -> float:
    """Measure how far a photo's normals move with its last digits.

    Parameters
    ----------
    photo : Photo
    belief : PredictionWeights
    seed : int

    Returns
    -------
    float
        Median over pixels, degrees.
    """
    working = photo.resized_to_object(_SIZE)
    image = working.image.astype(np.float64)
    change = 1 + 1e-7 * np.random.default_rng(seed).uniform(-1, 1, image.shape)
    seen = predict_scene(working.image, working.mask)
    first, second = (
        _normals(replace(working, image=values), seen, belief) for values in (image, image * change)
    )
    cosine = np.einsum("nc,nc->n", first[working.mask], second[working.mask])
    return float(np.median(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))


def _normals(photo: Photo, seen: ScenePrediction, belief: PredictionWeights) -> np.ndarray:
    options = SolveOptions(
        layer_dtype=np.float64, fit_lobe=False, check_assumptions=False, prediction_weights=belief
    )
    task = DecompositionTask(
        photo,
        photo,
        Settings("sirfs", threads=1),
        normal_estimate=seen.normals,
        shading_estimate=seen.shading,
        light_coefficients=seen.light,
        options=options,
    )
    return normals(solve(task).height)


def report(found: np.ndarray) -> str:
    """Format what has changed.

    Parameters
    ----------
    found : (photos, 2, columns) ndarray
        Of `compared`.

    Returns
    -------
    str
        A Markdown table.
    """
    ratio = np.log(found[:, 0] / found[:, 1])
    low, high = np.exp(interval(bootstrap_samples(ratio).mean(axis=1)))
    names = (*METRICS, "evaluations")
    cells = [
        f"{middle:.3f} ({a:.2f}-{b:.2f})"
        for middle, a, b in zip(np.exp(ratio.mean(axis=0)), low, high, strict=True)
    ]
    rule = "|---" * len(names) + "|"
    return "\n".join(["| " + " | ".join(names) + " |", rule, "| " + " | ".join(cells) + " |"])


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--part", choices=_PARTS, default=_PARTS[1], help="default: %(default)s")
    add("--count", type=int, default=48, help="photos of both parts (default: %(default)s)")
    add("--seed", type=int, default=7, help="of the photos (default: %(default)s)")
    add("--side", type=int, default=288, help="pixels of a photo (default: %(default)s)")
    add("--photos", type=Path, metavar="DIR", help="masked photos whose last digit is changed")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    try:
        made = lit_bodies(given.world, given.panoramas, given.count, given.seed, side=given.side)
    except InputError as error:
        parser.error(str(error))
    found = np.array([compared(lit) for lit in made[_PARTS.index(given.part) :: 2]])
    if given.json:
        given.json.write_text(json.dumps(found.tolist()), encoding="utf-8")
    print(report(found))
    if given.photos is None:
        return
    files = sorted(f for f in given.photos.iterdir() if f.suffix.lower() in _SUFFIXES)
    for name, belief in (("now", PHOTO_PREDICTIONS), ("before", LONG)):
        degrees = [moved(read_photo(file), belief, 0) for file in files]
        print(f"last digit, {name}: {np.median(degrees):.2f} degrees")


if __name__ == "__main__":
    main()
