"""How many points does it take to correct a mask? Measured on composites of held-out objects.

  python -m benchmarks.decomposition.corrected_masks WORLD --panoramas DIR [--photos DIR]
  [--part A|B] [--count N] [--points N] [--seed N] [--json FILE]

WORLD is a folder of `isc world build`. The objects are those of `training.masks.held_out`, before
crops of panoramas that no fit has seen, alone, of difficult kinds, or one of several. The mask
without hints comes first; it is empty if it is refused. Then a point is put where the mask is most
wrong: in the middle of the largest region that is missing or too much, on the object or on the
background. The overlap of the mask with the truth is reported after each point. Intervals are those
of resampled photos.

Citation: N. Xu et al. 2016, doi:10.1109/CVPR.2016.47.

Limits: those of `benchmarks.decomposition.automatic_mask`. People do not see the largest error.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy import ndimage

from benchmarks.bootstrap import bootstrap_samples, interval
from isc_core.errors import InputError
from isc_core.masking.confidence import mask_overlap
from isc_core.masking.hints import Hints, Point
from isc_core.masking.refusal import refusal_reason
from isc_core.masking.search import find_mask
from isc_core.networks.mask_network import Count
from training.masks.difficulty import SIMPLE, Difficulty
from training.masks.held_out import (
    PARTS,
    composites_of_targets,
    held_out_composites,
    held_out_ingredients,
)
from training.masks.packs import Ingredients

_KINDS = {"one": SIMPLE, "compound": Difficulty(compound=1), "cut by the frame": Difficulty(cut=1)}
_OF_SEVERAL = "one of several"
_RIGHT = 0.85  # overlap of a mask that needs no further point


@dataclass(frozen=True)
class Corrections:
    """A photo and what its points achieved.

    Attributes
    ----------
    kind : str
    overlaps : list of float
        Without points, with one, and so on.
    """

    kind: str
    overlaps: list[float]


def most_wrong_point(mask: np.ndarray, truth: np.ndarray) -> tuple[Point, bool] | None:
    """Return the pixel in the middle of a mask's largest error.

    Parameters
    ----------
    mask, truth : (H, W) bool ndarray

    Returns
    -------
    point : (x, y)
        The wrong pixel that is farthest from the right ones.
    on_object : bool
        Whether it is of the object.

    None if no pixel is wrong.
    """
    farthest, found = 0.0, None
    for on_object, wrong in ((True, truth & ~mask), (False, mask & ~truth)):
        distance = ndimage.distance_transform_edt(np.pad(wrong, 1))[1:-1, 1:-1]
        if distance.max() > farthest:
            farthest = float(distance.max())
            row, column = np.unravel_index(int(distance.argmax()), distance.shape)
            found = (int(column), int(row)), on_object
    return found


def correct(light: np.ndarray, truth: np.ndarray, most: int) -> list[float]:
    """Correct the mask of a photo by points.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
    truth : (H, W) bool ndarray
    most : int
        Points.

    Returns
    -------
    list of float
        Overlaps with the truth, without points, with one, and so on.
    """
    found, hints = find_mask(light), Hints()
    mask = np.zeros_like(truth) if refusal_reason(found) else found.mask
    overlaps = [mask_overlap(mask, truth)]
    while len(overlaps) <= most:
        wrong = most_wrong_point(mask, truth)
        if wrong is None or wrong[0] in (*hints.points, *hints.background):
            overlaps.append(overlaps[-1])
            continue
        point, on_object = wrong
        if on_object:
            hints = Hints((*hints.points, point), hints.background)
        else:
            hints = Hints(hints.points, (*hints.background, point))
        mask = find_mask(light, hints).mask
        overlaps.append(mask_overlap(mask, truth))
    return overlaps


def composites(
    ingredients: Ingredients, count: int, seed: int
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Compose the photos.

    Parameters
    ----------
    ingredients : Ingredients
    count : int
        Photos of each kind.
    seed : int

    Yields
    ------
    kind : str
    light : (H, W, 3) float32 ndarray
    truth : (H, W) bool ndarray
    """
    for kind, difficulty in _KINDS.items():
        for photo in held_out_composites(ingredients, Count.ONE, count, seed, difficulty):
            yield kind, photo.light, photo.cover >= 0.5
    torch.manual_seed(seed)
    rng = np.random.default_rng([seed, 77])
    for light, truth in composites_of_targets(ingredients, (0, 0, 1), count, rng):
        yield _OF_SEVERAL, light, truth


def report(found: list[Corrections]) -> str:
    """Format the figures.

    Parameters
    ----------
    found : list of Corrections

    Returns
    -------
    str
        A Markdown table: mean and 10th percentile of the overlap after each point, and the share of
        photos with an overlap of at least .85.
    """
    most = len(found[0].overlaps)
    lines = [
        "| photos | number | points | " + " | ".join(str(n) for n in range(most)) + " |",
        "|---|---|---" + "|---" * most + "|",
    ]
    for kind in (*dict.fromkeys(one.kind for one in found), ""):
        overlaps = np.array([one.overlaps for one in found if kind in ("", one.kind)])
        means = " | ".join(_mean(column) for column in overlaps.T)
        low = " | ".join(f"{np.quantile(column, 0.1):.2f}" for column in overlaps.T)
        right = " | ".join(f"{(column >= _RIGHT).mean():.0%}" for column in overlaps.T)
        lines.append(f"| {kind or 'all'} | {len(overlaps)} | mean | {means} |")
        lines.append(f"| | | 10th percentile | {low} |")
        lines.append(f"| | | at least {_RIGHT} | {right} |")
    return "\n".join(lines)


def _mean(values: np.ndarray) -> str:
    """The mean with its interval."""
    low, high = interval(bootstrap_samples(values).mean(axis=1))
    return f"{values.mean():.3f} ({low:.2f}-{high:.2f})"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--photos", type=Path, metavar="DIR", help="masked photos of real objects, too")
    add("--part", choices=PARTS, default="B", help="part of the objects (default: %(default)s)")
    add("--count", type=int, default=16, help="photos of each kind (default: %(default)s)")
    add("--points", type=int, default=4, help="points (default: %(default)s)")
    add("--seed", type=int, default=5, help="of the composites (default: %(default)s)")
    add("--json", type=Path, metavar="FILE", help="write the figures of each photo")
    given = parser.parse_args()
    try:
        sources = [None] if given.photos is None else [None, given.photos]
        parts = [
            held_out_ingredients(given.world, given.panoramas, given.part, source)
            for source in sources
        ]
    except InputError as error:
        parser.error(str(error))
    found = [
        Corrections(kind, correct(light, truth, given.points))
        for part in parts
        for kind, light, truth in composites(part, given.count, given.seed)
    ]
    print(report(found))
    if given.json is not None:
        given.json.write_text(json.dumps([[one.kind, one.overlaps] for one in found]))


if __name__ == "__main__":
    main()
