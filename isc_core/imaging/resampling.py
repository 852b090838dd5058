"""Resampling an object to the scale at which the priors were fitted, and its height map back.

The centre of pixel i lies at (i + 0.5) / factor - 0.5 of the source grid. Images are averaged over
the area of each new pixel (interpolated linearly when enlarged), with weights only inside the
object, so that no background bleeds in.
"""

import numpy as np

from ..filters.interpolation import banded_products, linear_interpolation, resampled_plane
from ..filters.splines import spline_coefficients, spline_values
from ..numerics.ellpack import Ellpack


def resampled_shape(shape: tuple[int, ...], factor: float) -> tuple[int, int]:
    """Return the shape of an image after scaling.

    Parameters
    ----------
    shape : tuple of int
        Shape of the image; rows and columns come first.
    factor : float
        Scale, greater than 0.

    Returns
    -------
    tuple of int
        (rows, columns), rounded, at least 1 each.
    """
    return max(1, round(shape[0] * factor)), max(1, round(shape[1] * factor))


def height_scale(old: tuple[int, ...], new: tuple[int, ...]) -> float:
    """Return the ratio of heights on a grid of shape `new` to those on a grid of shape `old`.

    Sizes are whole numbers, so it differs slightly from the requested factor.

    Parameters
    ----------
    old, new : tuple of int
        (H, W).

    Returns
    -------
    float
    """
    return float(np.sqrt(new[0] * new[1] / (old[0] * old[1])))


def resample_inside(
    values: np.ndarray, inside: np.ndarray, factor: float
) -> tuple[np.ndarray, np.ndarray]:
    """Resample the values inside a mask.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
    inside : (H, W) bool ndarray
    factor : float
        New size over old size.

    Returns
    -------
    values : ndarray
        0 where no pixel of the mask contributes.
    share : (h, w) ndarray
        Share of each new pixel that lies inside the mask, in [0, 1].
    """
    rows, columns = resampled_shape(inside.shape, factor)
    down, right = _weights(inside.shape[0], rows), _weights(inside.shape[1], columns)
    share = resampled_plane(inside, down, right)
    planes = values if values.ndim == 3 else values[..., None]
    sums = np.stack(
        [
            resampled_plane(np.where(inside, planes[..., c], 0.0), down, right)
            for c in range(planes.shape[2])
        ],
        axis=-1,
    )
    mean = sums / np.where(share > 1e-9, share, 1)[..., None]
    return (mean if values.ndim == 3 else mean[..., 0]), share


def resampled(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Resample a whole image: averages along an axis that shrinks, linear along one that grows.

    Parameters
    ----------
    values : (H, W) or (H, W, C) float32 ndarray
    shape : tuple of int
        (h, w) of the result.

    Returns
    -------
    (h, w) or (h, w, C) float32 ndarray
        The values themselves where the shape is the same.
    """
    rows, columns = values.shape[:2]
    if (rows, columns) == shape:
        return values
    down, right = (
        _weights(old, new, np.float32) for old, new in zip((rows, columns), shape, strict=True)
    )
    planes = values.reshape(rows, columns, -1)
    result = np.empty((*shape, planes.shape[2]), np.float32)
    for some, block in banded_products(down, planes):
        for c in range(block.shape[2]):
            result[some, :, c] = (right @ block[..., c].T).T
    return result.reshape(*shape, *values.shape[2:])


def resample_height(
    height: np.ndarray, shape: tuple[int, ...], factor: float | None = None
) -> np.ndarray:
    """Resample a smooth height map by cubic splines.

    Parameters
    ----------
    height : (h, w) ndarray
        Heights in pixels of its grid.
    shape : tuple of int
        (H, W) of the new grid.
    factor : float, optional
        Width of an old pixel in new pixels; None where both grids cover exactly the same area.

    Returns
    -------
    (H, W) ndarray
        Heights in pixels of the new grid.
    """
    if height.shape == shape and factor in (None, 1.0):
        return np.array(height, float)
    steps = [
        m / n if factor is None else 1 / factor for n, m in zip(shape, height.shape, strict=True)
    ]
    places = [
        np.clip((np.arange(n) + 0.5) * s - 0.5, 0, m - 1)
        for n, m, s in zip(shape, height.shape, steps, strict=True)
    ]
    scale = height_scale(height.shape, shape) if factor is None else factor
    return scale * spline_values(spline_coefficients(height, half_step=True), *places)


def nearest_samples(values: np.ndarray, shape: tuple[int, ...], factor: float) -> np.ndarray:
    """Sample a map at the centres of another grid; holes (NaN) are kept and do not grow.

    Parameters
    ----------
    values : (h, w) ndarray
    shape : tuple of int
        (H, W) of the new grid.
    factor : float
        Its pixels are 1 / factor old ones wide.

    Returns
    -------
    (H, W) ndarray
    """
    rows, columns = (
        np.minimum(((np.arange(n) + 0.5) / factor).astype(int), m - 1)
        for n, m in zip(shape, values.shape, strict=True)
    )
    return np.asarray(values[np.ix_(rows, columns)], float)


def _weights(size: int, new: int, dtype: type = np.float64) -> Ellpack:
    """(new, size) weights, rows summing to 1: box filter when shrinking, linear interpolation when
    enlarging.
    """
    if new >= size:
        return linear_interpolation((np.arange(new) + 0.5) * size / new - 0.5, size, dtype)
    edges = np.arange(new + 1) * (size / new)
    first, last = np.floor(edges[:-1]).astype(int), np.minimum(np.ceil(edges[1:]).astype(int), size)
    widest = int((last - first).max())
    column = first[:, None] + np.arange(widest)
    overlap = np.minimum(column + 1, edges[1:, None]) - np.maximum(column, edges[:-1, None])
    share = np.where((overlap > 1e-12) & (column < size), overlap * (new / size), 0)
    return Ellpack(np.minimum(column, size - 1), share.astype(dtype), size)
