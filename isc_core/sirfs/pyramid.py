"""Heights as sums over the levels of a Gaussian pyramid's adjoint, so that one optimiser updates
all scales at once.

Equation: Z = y_1 + D^T (y_2 + D^T (y_3 + ...)) with D the downsampling by one level: the filter
(1,3,3,1)/sqrt(8) along each axis with replicated edges, then decimation by two. The gradient of y_1
is dZ, that of y_{k+1} is D dy_k. Upsampling by one level doubles heights, since pixels are half as
large.

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.

Limits: replicated edges give the border nodes of very small levels large weights, so levels stop at
`SMALLEST`.
"""

import numpy as np

TAPS = tuple(float(v) for v in np.array([1, 3, 3, 1]) / np.sqrt(8))
SMALLEST = 4


def level_shapes(shape: tuple[int, ...], levels: int | None = None) -> list[tuple[int, ...]]:
    """Return the shapes of the levels, finest first.

    Parameters
    ----------
    shape : tuple of int
        Shape of the height map.
    levels : int, optional
        Number of levels; by default, as many as stay at or above `SMALLEST`.

    Returns
    -------
    list of tuple of int
    """
    shapes = [shape]
    while levels is None or len(shapes) < levels:
        rows, columns = ((n + 1) // 2 for n in shapes[-1])
        if levels is None and min(rows, columns) < SMALLEST:
            break
        shapes.append((rows, columns))
    return shapes


def down(fine: np.ndarray) -> np.ndarray:
    """Downsample by one level.

    Parameters
    ----------
    fine : (H, W) ndarray

    Returns
    -------
    (ceil(H / 2), ceil(W / 2)) ndarray
    """
    return _down_rows(_down_rows(fine).T).T


def up(coarse: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Apply the adjoint of `down`.

    Parameters
    ----------
    coarse : (ceil(H / 2), ceil(W / 2)) ndarray
    shape : tuple of int
        Shape (H, W) of the fine map.

    Returns
    -------
    (H, W) ndarray
    """
    rows = _up_rows(np.ascontiguousarray(coarse.T), shape[1]).T
    return _up_rows(np.ascontiguousarray(rows), shape[0])


def _down_rows(fine: np.ndarray) -> np.ndarray:
    """Filter and decimate along the first axis."""
    n = (fine.shape[0] + 1) // 2
    padded = np.concatenate([fine[:1], fine, fine[-1:], fine[-1:]])
    a, b = fine.dtype.type(TAPS[0]), fine.dtype.type(TAPS[1])
    outer = padded[0 : 2 * n : 2] + padded[3 : 2 * n + 3 : 2]
    return outer * a + (padded[1 : 2 * n + 1 : 2] + padded[2 : 2 * n + 2 : 2]) * b


def _up_rows(coarse: np.ndarray, size: int) -> np.ndarray:
    """Adjoint of `_down_rows` for `size` fine rows."""
    n = coarse.shape[0]
    padded = np.zeros((size + 3, *coarse.shape[1:]), coarse.dtype)
    outer, inner = coarse * coarse.dtype.type(TAPS[0]), coarse * coarse.dtype.type(TAPS[1])
    padded[0 : 2 * n : 2] += outer
    padded[1 : 2 * n + 1 : 2] += inner
    padded[2 : 2 * n + 2 : 2] += inner
    padded[3 : 2 * n + 3 : 2] += outer
    padded[1] += padded[0]
    padded[size] += padded[size + 1] + padded[size + 2]
    return padded[1 : size + 1]


def synthesise(levels: list[np.ndarray]) -> np.ndarray:
    """Return the height map of the levels.

    Parameters
    ----------
    levels : list of ndarray
        Finest first.

    Returns
    -------
    (H, W) ndarray
        Of the shape of the finest level.
    """
    height = levels[-1]
    for level in levels[-2::-1]:
        height = level + up(height, level.shape)
    return height


def analyse(gradient: np.ndarray, out: list[np.ndarray]) -> None:
    """Apply the adjoint of `synthesise`.

    Parameters
    ----------
    gradient : (H, W) ndarray
    out : list of ndarray
        Output: the gradient of each level, finest first.
    """
    out[0][...] = gradient
    for fine, coarse in zip(out[:-1], out[1:], strict=True):
        coarse[...] = down(fine)
