"""Binary labels of pixels by a minimum cut of their grid.

Problem: each pixel has a cost of being object and one of being background, and neighbours with
different labels have a cost; find the labels with the least sum.

Equation: E(a) = sum_p D_p(a_p) + sum_pq V_pq [a_p != a_q] over the eight neighbours. In the graph
whose edges to the two terminals have the capacities D and whose edges between neighbours have V,
the cost of a cut is that of its labels, and the maximum flow gives the minimum cut.

Citation: D. Greig, B. Porteous, A. Seheult, "Exact maximum a posteriori estimation for binary
images", Journal of the Royal Statistical Society B 51 (1989),
doi:10.1111/j.2517-6161.1989.tb01764.x; the flow: see `numerics.maximum_flow`.

Limits: costs are rounded to multiples of 1 / `SCALE`. The time grows with the noise of the costs,
and somewhat faster than the number of pixels: some 100,000 take a quarter of a second.
"""

import numpy as np

from ..numerics.maximum_flow import source_side

SCALE = 32
_LARGEST = 200.0  # of a cost difference
# Row and column of the neighbours below and to the right.
STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


def shifted(shape: tuple[int, ...], step: tuple[int, int]) -> tuple[tuple[slice, slice], ...]:
    """Return the slices of all pixels that have a neighbour, and of these neighbours.

    Parameters
    ----------
    shape : tuple of int
        (H, W).
    step : tuple of int
        One of `STEPS`.

    Returns
    -------
    tuple of two (slice, slice)
    """
    (down, right), (height, width) = step, shape[:2]
    here = slice(0, height - down), slice(max(-right, 0), width - max(right, 0))
    there = slice(down, height), slice(max(right, 0), width + min(right, 0))
    return here, there


def minimum_cut(
    difference: np.ndarray, links: list[np.ndarray], free: np.ndarray, fixed: np.ndarray
) -> np.ndarray:
    """Label the free pixels of an image.

    Parameters
    ----------
    difference : (H, W) float ndarray
        Cost of being background less that of being object.
    links : list of four float ndarray
        Costs of different labels, not negative, at the first slices of `shifted` for each of
        `STEPS`.
    free : (H, W) bool ndarray
        Pixels to label.
    fixed : (H, W) bool ndarray
        Labels of the others; True is object.

    Returns
    -------
    (H, W) bool ndarray
        The labels; those of `fixed` where no pixel is free.
    """
    shape = free.shape
    number = np.full(shape, -1)
    number[free] = np.arange(int(free.sum()))
    pull = np.clip(difference, -_LARGEST, _LARGEST)
    ends = []
    for step, link in zip(STEPS, links, strict=True):
        here, there = shifted(shape, step)
        for at, other in ((here, there), (there, here)):
            pull[at] += np.where(free[other], 0, np.where(fixed[other], link, -link))
        both = free[here] & free[there]
        ends.append((number[here][both], number[there][both], link[both]))
    first, second, weight = (np.concatenate(parts) for parts in zip(*ends, strict=True))
    on_object = source_side(_rounded(pull[free]), first, second, _rounded(weight))
    result = fixed.copy()
    result[free] = on_object
    return result


def _rounded(costs: np.ndarray) -> np.ndarray:
    return np.rint(SCALE * costs).astype(np.int32)
