"""The smallest box around a mask."""

import numpy as np


def mask_slices(mask: np.ndarray) -> tuple[slice, slice]:
    """Return the rows and columns of the smallest box around a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        At least one pixel is set.

    Returns
    -------
    rows, columns : slice
    """
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def mask_box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Return the smallest box around a mask as (x, y, width, height), in pixels.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        At least one pixel is set.

    Returns
    -------
    tuple of int
        x and y are the left column and the top row.
    """
    rows, columns = mask_slices(mask)
    return (
        int(columns.start),
        int(rows.start),
        int(columns.stop - columns.start),
        int(rows.stop - rows.start),
    )


def mask_diagonal(mask: np.ndarray) -> float:
    """Return the diagonal of the smallest box around a mask, in pixels.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        At least one pixel is set.

    Returns
    -------
    float
    """
    _, _, width, height = mask_box(mask)
    return float(np.hypot(height, width))
