"""Upsampling of maps by two, by linear interpolation between the centres of pixels.

Limits: at the border of a map the outermost values are replicated.
"""

import numpy as np

from .tiles import Place


def doubled(values: np.ndarray) -> np.ndarray:
    """Interpolate maps linearly to twice the size.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray

    Returns
    -------
    (2 H, 2 W) or (2 H, 2 W, C) ndarray
    """
    return _doubled_rows(_doubled_rows(values).swapaxes(0, 1)).swapaxes(0, 1)


def doubled_at(values: np.ndarray, place: Place) -> np.ndarray:
    """Return a part of `doubled`.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
    place : tuple of slice
        Rows and columns of the result, with even ends.

    Returns
    -------
    (n, m) or (n, m, C) ndarray
    """
    wide = tuple(slice(max(one.start // 2 - 1, 0), one.stop // 2 + 1) for one in place)
    rows, columns = (
        slice(one.start - 2 * near.start, one.stop - 2 * near.start)
        for one, near in zip(place, wide, strict=True)
    )
    return doubled(values[wide])[rows, columns]


def _doubled_rows(values: np.ndarray) -> np.ndarray:
    padded = np.concatenate([values[:1], values, values[-1:]])
    out = np.empty((2 * len(values), *values.shape[1:]), values.dtype)
    near = 0.75 * values
    out[0::2] = near + 0.25 * padded[:-2]
    out[1::2] = near + 0.25 * padded[2:]
    return out
