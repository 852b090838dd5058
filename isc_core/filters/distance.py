# mypy: disable-error-code="no-untyped-def"
"""Euclidean distance to a mask, and its nearest pixel.

Equation: the nearest pixel in each column is found by two passes along it; along each row, the
column with the least squared distance is that of the lower envelope of parabolas. All is exact, in
integers. Of equally near pixels, that in the first column counts, and in it the first.

Citation: A. Meijster, J. B. T. M. Roerdink and W. H. Hesselink 2000, doi:10.1007/0-306-47025-X_36.
"""

import numpy as np

from ..numerics.jit import jit


def nearest_pixels(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the pixel of a mask that is nearest to each pixel.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        With at least one pixel.

    Returns
    -------
    rows, columns : (H, W) int32 ndarray

    Raises
    ------
    ValueError
        If the mask is empty.
    """
    if not mask.any():
        raise ValueError("an empty mask has no nearest pixel")
    rows, columns = np.empty(mask.shape, np.int32), np.empty(mask.shape, np.int32)
    memory = np.empty((4, mask.shape[1]), np.int64)
    _nearest(np.ascontiguousarray(mask), rows, columns, memory)
    return rows, columns


def distances(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the distance of each pixel from another one.

    Parameters
    ----------
    rows, columns : (H, W) int32 ndarray
        The other pixel.

    Returns
    -------
    (H, W) float64 ndarray
        In pixels.
    """
    down = rows - np.arange(rows.shape[0], dtype=rows.dtype)[:, None]
    across = columns - np.arange(rows.shape[1], dtype=rows.dtype)
    return np.asarray(np.sqrt((down * down + across * across).astype(float)))


def distance_to(mask: np.ndarray) -> np.ndarray:
    """Return the distance of each pixel from the nearest pixel of a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        With at least one pixel.

    Returns
    -------
    (H, W) float64 ndarray
        In pixels; 0 inside the mask.

    Raises
    ------
    ValueError
        If the mask is empty.
    """
    return distances(*nearest_pixels(mask))


@jit(types="b1[2] i4[2] i4[2] i8[2]")
def _nearest(mask, rows, columns, memory):
    """Write the nearest pixels; `memory` holds, for one row, the columns of the envelope, where
    each begins, the nearest pixels in all columns, and their squared distances.
    """
    height, width = mask.shape
    owners, starts, near, squares = memory[0], memory[1], memory[2], memory[3]
    for j in range(width):
        rows[0, j] = 0 if mask[0, j] else -1
    for i in range(1, height):
        for j in range(width):
            rows[i, j] = i if mask[i, j] else rows[i - 1, j]
    for i in range(height - 2, -1, -1):
        for j in range(width):
            above, below = rows[i, j], rows[i + 1, j]
            if below >= 0 and (above < 0 or below - i < i - above):
                rows[i, j] = below
    for i in range(height):
        last = -1
        for j in range(width):
            near[j] = rows[i, j]
            if near[j] < 0:
                continue
            squares[j] = (near[j] - i) * (near[j] - i)
            start = 0
            while last >= 0:
                old, at = owners[last], starts[last]
                if (at - old) * (at - old) + squares[old] <= (at - j) * (at - j) + squares[j]:
                    # the last column at which the old one is as near
                    gain = (j * j - old * old + squares[j] - squares[old]) // (2 * (j - old))
                    start = gain + 1
                    break
                last -= 1
            if start < width:
                last += 1
                owners[last], starts[last] = j, start
        for j in range(width - 1, -1, -1):
            columns[i, j] = owners[last]
            rows[i, j] = near[owners[last]]
            if j == starts[last]:
                last -= 1
