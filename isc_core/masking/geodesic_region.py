"""The region around points that contradict a mask.

Problem: a point on the object lies outside its mask, or a point on the background inside. Around
the point, the mask has to change, up to an edge of the photo, and no further.

Equation: the geodesic distance between two pixels is the least sum over a path of

    |c_p - c_q| + lambda |p - q|

for neighbours p and q with sRGB colours c in [0, 1]. A pixel with the contradicted label changes it
if it is nearer to a contradicting point than to all points of its label, and to the half of the
pixels of that label that are farthest from the contradicting points. Of the background, pixels
count as far, too, whose plain distance from each contradicting point is three times that from the
point to the mask: the missing part of an object is beside the mask.

Citation: X. Bai, G. Sapiro 2007, doi:10.1109/ICCV.2007.4408931; E. W. Dijkstra 1959,
doi:10.1007/BF01386390.

Limits: a border between like colours is where the distances are equal; half of the contradicted
region at most is assumed to be wrong.
"""

from typing import TYPE_CHECKING

import numpy as np

from ..filters.components import labelled
from ..filters.distance import distance_to
from ..imaging.minimum_cut import STEPS, shifted

if TYPE_CHECKING:
    from scipy import sparse

_STEP = 0.01  # lambda: change of colour that is as far as one pixel
_FAR = 0.5  # quantile of the distance from which pixels keep their label
_REACH = 3.0  # the same in plain distance, over that from the point to the mask

Pixels = list[tuple[int, int]]


def with_changed_regions(
    codes: np.ndarray, mask: np.ndarray, inside: Pixels, outside: Pixels
) -> np.ndarray:
    """Change a mask around the points that contradict it.

    Parameters
    ----------
    codes : (H, W, 3) float ndarray
        sRGB, 0 to 1; small, 128 pixels long or so.
    mask : (H, W) bool ndarray
    inside, outside : list of (row, column)
        Points on the object and on the background.

    Returns
    -------
    (H, W) bool ndarray
    """
    changed = mask.copy()
    graph = _graph(codes)
    for label, points, opposite in ((True, inside, outside), (False, outside, inside)):
        wrong = [at for at in points if mask[at] != label]
        if wrong:
            kept = _beyond_reach(mask, wrong) if label else np.zeros_like(mask)
            changed[_region(graph, mask != label, wrong, opposite, kept)] = label
    return changed


def _beyond_reach(mask: np.ndarray, points: Pixels) -> np.ndarray:
    """The pixels (H, W) too far from points outside a mask."""
    to_mask = distance_to(mask) if mask.any() else np.full(mask.shape, np.inf)
    rows, columns = np.indices(mask.shape)
    return np.all(
        [np.hypot(rows - row, columns - column) > _REACH * to_mask[row, column]
         for row, column in points], axis=0,
    )  # fmt: skip


def _region(
    graph: "sparse.csr_matrix",
    candidates: np.ndarray,
    wrong: Pixels,
    opposite: Pixels,
    kept: np.ndarray,
) -> np.ndarray:
    """The candidates (H, W) that belong to the wrong points, connected to one of them; `kept` do
    not.
    """
    distance = _distance(graph, candidates.shape, _at(candidates.shape, wrong))
    kept = candidates & (kept | (distance >= np.quantile(distance[candidates], _FAR)))
    kept[tuple(np.transpose(wrong))] = False
    seeds = np.concatenate([np.flatnonzero(kept), _at(candidates.shape, opposite)])
    if len(seeds):
        candidates = candidates & (distance < _distance(graph, candidates.shape, seeds))
    labels, _ = labelled(candidates)
    reached = np.unique(labels[tuple(np.transpose(wrong))])
    return np.isin(labels, reached[reached > 0])


def _at(shape: tuple[int, ...], points: Pixels) -> np.ndarray:
    """Flat indices of pixels."""
    return np.array([row * shape[1] + column for row, column in points], np.int64)


def _graph(codes: np.ndarray) -> "sparse.csr_matrix":
    """Distances of neighbours, each pair once."""
    # Imported only for points: every command imports this module.
    from scipy import sparse

    height, width = codes.shape[:2]
    number = np.arange(height * width).reshape(height, width)
    starts, ends, lengths = [], [], []
    for step in STEPS:
        here, there = shifted((height, width), step)
        change = np.sqrt(((codes[here] - codes[there]) ** 2).sum(axis=2))
        starts.append(number[here].ravel())
        ends.append(number[there].ravel())
        lengths.append((change + _STEP * np.hypot(*step)).ravel())
    pairs = np.concatenate(starts), np.concatenate(ends)
    return sparse.csr_matrix((np.concatenate(lengths), pairs), (number.size, number.size))


def _distance(graph: "sparse.csr_matrix", shape: tuple[int, ...], seeds: np.ndarray) -> np.ndarray:
    """Geodesic distance (H, W) to the nearest seed."""
    from scipy.sparse.csgraph import dijkstra

    found = dijkstra(graph, directed=False, indices=np.unique(seeds), min_only=True)
    return np.asarray(found).reshape(shape)
