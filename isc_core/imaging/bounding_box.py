"""The smallest box around a mask."""

import numpy as np


def mask_slices(mask: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns of `mask` (H, W) bool, of which some pixel must be set, from the first to
    the last that has one.
    """
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def mask_box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """(x, y, width, height) of the smallest box around the true pixels of an (H, W) mask that has
    some.
    """
    rows, columns = mask_slices(mask)
    return (
        int(columns.start),
        int(rows.start),
        int(columns.stop - columns.start),
        int(rows.stop - rows.start),
    )
