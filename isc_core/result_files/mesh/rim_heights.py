"""Regularised heights near the silhouette.

Problem: the true slope of a smooth object is infinite at its silhouette, so the outermost heights
of a reconstruction are the least certain and may spike.

Method: from the inside out, the step of a height in the outermost rings from its inner neighbours
is limited to 1.5 times their own step plus half a pixel; this rule preserves a sphere. Then the
outermost ring is averaged along itself over 5 x 5 pixels: the silhouette has the steps of the pixel
grid, and on a steep rim each of them would be a tooth of many pixels in depth.

Limits: a true spike at the silhouette is flattened, too.
"""

import numpy as np

_ALONG = 2  # pixels, the reach of the average along the outermost ring


def limit_rim(height: np.ndarray, mask: np.ndarray, rings: int) -> np.ndarray:
    """Limit the heights of the outermost rings by those inside (see the module).

    Parameters
    ----------
    height : (H, W) ndarray
    mask : (H, W) bool ndarray
    rings : int

    Returns
    -------
    (H, W) float64 ndarray
    """
    depth = np.pad(_depths(mask, rings + 2), _ALONG)  # 1 in the outermost ring
    limited = np.pad(np.where(mask, height, 0.0).astype(np.float64, copy=False), _ALONG)
    flat, step = limited.reshape(-1), np.zeros(limited.size)
    for ring in range(rings + 1, 0, -1):
        at = np.flatnonzero(depth == ring)
        base, count = _neighbour_mean(limited, depth > ring, at)
        at, base = at[count > 0], base[count > 0]
        if ring <= rings:
            inner = _neighbour_mean(step.reshape(limited.shape), depth > ring, at)[0]
            slack = 1.5 * inner + 0.5
            flat[at] = np.clip(flat[at], base - slack, base + slack)
        step[at] = np.abs(flat[at] - base)
    if rings > 0:
        outermost = depth == 1
        at = np.flatnonzero(outermost)
        flat[at] = _neighbour_mean(limited, outermost, at, _ALONG)[0]
    return limited[_ALONG:-_ALONG, _ALONG:-_ALONG]


def _depths(mask: np.ndarray, most: int) -> np.ndarray:
    """The number (H, W) of each pixel's ring, counted from the outside, at most `most`."""
    depth, inside = mask.astype(np.int16), mask
    for _ in range(most - 1):
        wide = np.pad(inside, 1)
        rows = wide[:-2] & wide[1:-1] & wide[2:]
        inside = rows[:, :-2] & rows[:, 1:-1] & rows[:, 2:]
        depth += inside
    return depth


def _neighbour_mean(
    values: np.ndarray, valid: np.ndarray, at: np.ndarray, reach: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the valid pixels at most `reach` rows and columns from the pixels of flat indices
    `at`, and their number, each (n,).
    """
    total, count = np.zeros(len(at)), np.zeros(len(at), int)
    for row in range(-reach, reach + 1):
        for column in range(-reach, reach + 1):
            near = at + row * values.shape[1] + column
            known = valid.reshape(-1)[near]
            total += np.where(known, values.reshape(-1)[near], 0)
            count += known
    return total / np.maximum(count, 1), count
