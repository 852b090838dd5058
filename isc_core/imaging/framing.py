"""Objects at the frame of the photo: truncated by it, or merely cropped to it.

Where the frame cuts the object, the object's outline is no occluding contour; where a photo was
merely cropped to the object, it is. A run of mask pixels along the frame counts as a cut if the
mask is hardly wider a few pixels further in (`CUT_RATIO`); a rounded outline that touches the frame
widens quickly.

Limits: a box-shaped object cropped exactly along its sides counts as cut.
"""

import numpy as np

from ..filters.components import labelled
from ..filters.distance import nearest_pixels

DEPTH = 5
CUT_RATIO = 0.75


def cut_line(mask: np.ndarray) -> np.ndarray:
    """Return the pixels of the first row where the frame cuts the object.

    Parameters
    ----------
    mask : (H, W) bool ndarray

    Returns
    -------
    (W,) bool ndarray
    """
    line, inner = mask[0], mask[min(DEPTH, mask.shape[0] - 1)]
    (runs,), count = labelled(line[None])
    (inner_runs,), _ = labelled(inner[None])
    cut = np.zeros_like(line)
    for run in range(1, count + 1):
        here = runs == run
        touched = np.unique(inner_runs[here & inner])
        width = int(np.isin(inner_runs, touched).sum()) if len(touched) else 0
        if here.sum() >= CUT_RATIO * width > 0:
            cut |= here
    return cut


def is_cut(mask: np.ndarray) -> bool:
    """Return whether the frame cuts an object.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        Pixels of the object.

    Returns
    -------
    bool
    """
    return any(bool(cut_line(m).any()) for m in _sides(mask))


def _sides(mask: np.ndarray) -> tuple[np.ndarray, ...]:
    """`mask`, rotated so that its upper, lower, left and right side is the first row."""
    return mask, mask[::-1], mask.T, mask.T[::-1]


def continued(mask: np.ndarray, top: int, bottom: int, left: int, right: int) -> np.ndarray:
    """Extend a mask beyond the frame; the object continues where the frame cuts it.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    top, bottom, left, right : int
        Rows and columns to add.

    Returns
    -------
    (H + top + bottom, W + left + right) bool ndarray
    """
    upper, lower, first, last = (cut_line(m) for m in _sides(mask))
    out = np.pad(mask, [(top, bottom), (left, right)])
    rows, columns = slice(top, top + mask.shape[0]), slice(left, left + mask.shape[1])
    out[:top, columns], out[top + mask.shape[0] :, columns] = upper, lower
    out[rows, :left], out[rows, left + mask.shape[1] :] = first[:, None], last[:, None]
    out[:top, :left], out[:top, left + mask.shape[1] :] = upper[0] & first[0], upper[-1] & last[0]
    out[top + mask.shape[0] :, :left] = lower[0] & first[-1]
    out[top + mask.shape[0] :, left + mask.shape[1] :] = lower[-1] & last[-1]
    return out


def continued_height(height: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Extend a height map beyond the mask by point reflection at the rim.

    Normals are computed from pixels one step outside.

    Parameters
    ----------
    height : (H, W) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W) ndarray
    """
    rim = nearest_pixels(mask)
    rows, columns = (
        np.clip(2 * r - i, 0, n - 1)
        for r, i, n in zip(rim, np.indices(mask.shape), mask.shape, strict=True)
    )
    at_rim = height[rim]
    return np.where(
        mask, height, np.where(mask[rows, columns], 2 * at_rim - height[rows, columns], at_rim)
    )
