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
from scipy import ndimage


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
    depth = ndimage.distance_transform_cdt(np.pad(mask, 1), "chessboard")[1:-1, 1:-1]
    depth = np.minimum(depth, rings + 2).astype(np.int16)  # 1 in the outermost ring
    limited = np.where(mask, height, 0.0).astype(np.float64, copy=False)
    step = np.zeros(mask.shape, np.float64)
    for ring in range(rings + 1, 0, -1):
        at = np.nonzero(depth == ring)
        base, weight = _neighbour_mean(limited, depth > ring, at)
        at, base = tuple(part[weight > 0] for part in at), base[weight > 0]
        if ring <= rings:
            slack = 1.5 * _neighbour_mean(step, depth > ring, at)[0] + 0.5
            limited[at] = np.clip(limited[at], base - slack, base + slack)
        step[at] = np.abs(limited[at] - base)
    if rings > 0:
        outermost = depth == 1
        at = np.nonzero(outermost)
        limited[at] = _neighbour_mean(limited, outermost, at, 5)[0]
    return limited


def _neighbour_mean(
    values: np.ndarray, valid: np.ndarray, at: tuple[np.ndarray, ...], size: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the valid pixels in the `size` x `size` neighbourhood of pixels `at`, and their
    number, each (n,).
    """
    total = np.where(valid, values, 0.0)
    ndimage.uniform_filter(total, size, output=total, mode="constant")
    weight = ndimage.uniform_filter(valid.astype(np.float32), size, mode="constant")
    count = np.rint(weight[at].astype(np.float64) * size**2)
    return total[at] * size**2 / np.maximum(count, 1), count
