"""The smallest box around a mask."""

import numpy as np


def mask_slices(mask: np.ndarray, margin: int = 0) -> tuple[slice, slice]:
    """Return the rows and columns of the smallest box around a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        At least one pixel is set.
    margin : int, optional
        Pixels around the box, clipped at the frame.

    Returns
    -------
    rows, columns : slice
    """
    along = ((np.flatnonzero(mask.any(axis=1 - k)), mask.shape[k]) for k in (0, 1))
    rows, columns = (
        slice(max(set_[0] - margin, 0), min(set_[-1] + 1 + margin, size)) for set_, size in along
    )
    return rows, columns


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
