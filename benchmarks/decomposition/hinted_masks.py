"""How good are masks that points and boxes make, and is their confidence what it says?

  python -m benchmarks.decomposition.hinted_masks PHOTOS --panoramas DIR [--weights NPZ]
  [--count N] [--json FILE]

Composites of masked photos of real objects before crops of panoramas that no fit has seen, half of
them with other objects beside. One object is the target. A box around it leaves up to 15 % on each
side; points are one to three pixels of it, and with `not` one or two of the background besides. A
mask is right with an overlap of .5. The weights of the confidence are those fitted without hints;
nothing here was chosen on these composites. What is refused counts as an empty mask with confidence
0. Intervals are those of resampled masks.

Limits: those of `benchmarks.decomposition.automatic_mask`. Pixels are drawn evenly; people point at
the middle.
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
from isc_core.imaging.bounding_box import mask_box
from isc_core.masking.confidence import mask_overlap
from isc_core.masking.hints import Hints, Point
from isc_core.masking.search import find_mask
from isc_core.networks.mask_network import MaskNetwork
from training.masks.held_out import composites_of_targets, masked_cutout
from training.masks.packs import Ingredients
from training.world.backgrounds import panoramas_in

KINDS = ("box", "points", "points and not")
_SEED = 5
_MOST_MARGIN = 0.15  # of a box, of the object's width or height
_RIGHT = 0.5  # overlap
_BINS = (0.0, 0.5, 0.8, 0.95, 1.01)  # of confidence


@dataclass(frozen=True)
class MaskScore:
    """A mask that hints made.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    overlap : float
        Intersection over union with the truth.
    confidence : float
    """

    kind: str
    overlap: float
    confidence: float


def composites(
    photos: Path, panoramas: Path, count: int
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Compose photos.

    Parameters
    ----------
    photos, panoramas : Path
    count : int

    Yields
    ------
    light : (H, W, 3) float32 ndarray
    truth : (H, W) bool ndarray
        Mask of the target.
    """
    rng = np.random.default_rng(_SEED)
    torch.manual_seed(_SEED)
    pictures = [masked_cutout(path) for path in sorted(photos.glob("*.png"))]
    rooms, patterns = panoramas_in(panoramas, held_out=True), np.zeros((1, 8, 8), np.uint8)
    ingredients = Ingredients(np.stack(pictures), rooms, patterns)
    yield from composites_of_targets(ingredients, (0, 0.5, 0.5), count, rng)


def drawn_hints(truth: np.ndarray, kind: str, rng: np.random.Generator) -> Hints:
    """Draw hints as a user gives them.

    Parameters
    ----------
    truth : (H, W) bool ndarray
    kind : str
        One of `KINDS`.
    rng : numpy.random.Generator

    Returns
    -------
    Hints
    """
    if kind == "box":
        x, y, width, height = mask_box(truth)
        left, right, above, below = (
            int(np.ceil(share * side))
            for share, side in zip(
                rng.uniform(0, _MOST_MARGIN, 4), (width, width, height, height), strict=True
            )
        )
        first = max(x - left, 0), max(y - above, 0)
        last = min(x + width + right, truth.shape[1]), min(y + height + below, truth.shape[0])
        return Hints(box=(*first, last[0] - first[0], last[1] - first[1]))
    inner = ndimage.binary_erosion(truth, iterations=2)
    points = _some(inner if inner.any() else truth, rng, int(rng.integers(1, 4)))
    around = ~ndimage.binary_dilation(truth, iterations=3)
    if kind == "points" or not around.any():
        return Hints(points)
    return Hints(points, _some(around, rng, int(rng.integers(1, 3))))


def _some(where: np.ndarray, rng: np.random.Generator, count: int) -> tuple[Point, ...]:
    rows, columns = np.nonzero(where)
    return tuple((int(columns[k]), int(rows[k])) for k in rng.integers(len(rows), size=count))


def score_masks(
    photos: Path, panoramas: Path, count: int, network: MaskNetwork | None = None
) -> list[MaskScore]:
    """Make masks from hints of each kind on composites.

    Parameters
    ----------
    photos, panoramas : Path
    count : int
        Of composites.
    network : MaskNetwork, optional
        By default the shipped one.

    Returns
    -------
    list of MaskScore
    """
    rng = np.random.default_rng([_SEED, 1])
    return [
        MaskScore(kind, *_score(light, truth, drawn_hints(truth, kind, rng), network))
        for light, truth in composites(photos, panoramas, count)
        for kind in KINDS
    ]


def _score(
    light: np.ndarray, truth: np.ndarray, hints: Hints, network: MaskNetwork | None
) -> tuple[float, float]:
    try:
        found = find_mask(light, hints, network)
    except InputError:
        return 0.0, 0.0
    return mask_overlap(found.mask, truth), found.confidence


def report(found: list[MaskScore]) -> str:
    """Format the figures.

    Parameters
    ----------
    found : list of MaskScore

    Returns
    -------
    str
        Two Markdown tables: by kind of hint, and by confidence.
    """
    lines = [
        "| hints | masks | IoU, median | 10th percentile | right | mean confidence |",
        "|---|---|---|---|---|---|",
    ]
    for kind in (*KINDS, ""):
        chosen = [one for one in found if kind in ("", one.kind)]
        overlap = np.array([one.overlap for one in chosen])
        middle, low = np.quantile(overlap, (0.5, 0.1))
        mean = np.mean([one.confidence for one in chosen])
        lines.append(
            f"| {kind or 'all'} | {len(chosen)} | {middle:.3f} | {low:.3f} | {_right(overlap)} "
            f"| {mean:.1%} |"
        )
    lines += ["", "| confidence | masks | mean confidence | right |", "|---|---|---|---|"]
    for least, most in zip(_BINS, _BINS[1:], strict=False):
        chosen = [one for one in found if least <= one.confidence < most]
        if chosen:
            mean = np.mean([one.confidence for one in chosen])
            right = _right(np.array([one.overlap for one in chosen]))
            lines.append(
                f"| {least:.0%} to {min(most, 1):.0%} | {len(chosen)} | {mean:.1%} | {right} |"
            )
    return "\n".join(lines)


def _right(overlap: np.ndarray) -> str:
    """The share of right masks with its interval."""
    right = overlap >= _RIGHT
    low, high = interval(bootstrap_samples(right).mean(axis=1))
    return f"{right.mean():.1%} ({100 * low:.0f}-{100 * high:.0f})"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("photos", type=Path, metavar="PHOTOS", help="folder of photos on black or transparent")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--weights", type=Path, metavar="NPZ", help="mask network (default: the shipped one)")
    add("--count", type=int, default=100, help="composites (default: %(default)s)")
    add("--json", type=Path, metavar="FILE", help="write every mask's figures")
    given = parser.parse_args()
    try:
        network = None if given.weights is None else MaskNetwork.read(given.weights)
        found = score_masks(given.photos, given.panoramas, given.count, network)
    except InputError as error:
        parser.error(str(error))
    print(report(found))
    if given.json is not None:
        rows = [[one.kind, one.overlap, one.confidence] for one in found]
        given.json.write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
