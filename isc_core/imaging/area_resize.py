"""Downscaling by exact area averages, object and background separately.

Equation: each new pixel is the mean of the old ones, weighted by the overlap of their areas and by
the mask: the premultiplied images of T. Porter and T. Duff, "Compositing Digital Images" (1984),
doi:10.1145/800031.808606. Neither the background nor the object bleeds into the other.

Limits: downscaling only.
"""

# mypy: disable-error-code="no-untyped-def"
# (the compiler infers the types of every call)

from dataclasses import dataclass

import numpy as np

from ..filters.interpolation import resampled_plane
from ..numerics.ellpack import Ellpack
from ..numerics.jit import jit
from .bounding_box import FramePart, mask_slices


@dataclass(frozen=True, eq=False)
class AreaFilter:
    """Integrate an (H, W) array over square pixels of side 1 / factor, exactly.

    The last row and column may extend past the image.

    Attributes
    ----------
    rows, columns : Ellpack
        Overlap of new and old rows and columns.
    full : (h, w) ndarray
        Area of each new pixel that lies on the image.
    """

    rows: Ellpack
    columns: Ellpack
    full: np.ndarray

    @staticmethod
    def of(shape: tuple[int, ...], factor: float) -> "AreaFilter":
        """Return the filter for images of one shape and one scale.

        Parameters
        ----------
        shape : tuple of int
            (H, W) of the images.
        factor : float
            Scale in (0, 1].

        Returns
        -------
        AreaFilter
        """
        rows, columns = _overlaps(shape[0], factor), _overlaps(shape[1], factor)
        down, across = rows @ np.ones(shape[0]), columns @ np.ones(shape[1])
        return AreaFilter(rows, columns, np.outer(down, across))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return resampled_plane(values, self.rows, self.columns)

    def means(self, values: np.ndarray, part: FramePart) -> np.ndarray:
        """Average over the pixels of a part of the new frame.

        Parameters
        ----------
        values : (H, W) ndarray
        part : FramePart

        Returns
        -------
        (h, w) float32 ndarray
            As large as the part, or smaller where that extends past the frame.
        """
        down, old_rows = self.rows.band(part.rows)
        across, old_columns = self.columns.band(part.columns)
        sums = resampled_plane(values[old_rows, old_columns], down, across)
        return np.asarray(sums / np.maximum(self.full[part.rows, part.columns], 1e-6))


def reduced_count(count: int, factor: float) -> int:
    """Return the number of new pixels along an axis.

    Parameters
    ----------
    count : int
        Old pixels.
    factor : float
        Scale in (0, 1].

    Returns
    -------
    int
        The last may extend past the old ones.
    """
    return max(1, int(np.ceil(count * factor - 1e-6)))


def _overlaps(count: int, factor: float) -> Ellpack:
    """(new, old) float32: the share of each new pixel covered by each of the `count` old
    pixels; 0 < factor <= 1.
    """
    new = reduced_count(count, factor)
    start, end = np.arange(count) * factor, np.arange(1, count + 1) * factor
    first = np.minimum(start.astype(int), new - 1)
    split = np.clip(first + 1.0, start, end)
    second = np.minimum(first + 1, new - 1)
    weights = np.concatenate([split - start, end - split]).astype(np.float32)
    old = np.arange(count)
    return Ellpack.of(
        np.concatenate([first, second]), np.concatenate([old, old]), weights, (new, count)
    )


def averaged_object(
    image: np.ndarray, mask: np.ndarray, long_side: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Apply `averaged` to the box of an object.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    long_side : int
        Largest long side of the result, in pixels.

    Returns
    -------
    image, mask, factor
        See `averaged`.
    """
    box = mask_slices(mask)
    return averaged(image[box], mask[box], min(1.0, long_side / max(mask[box].shape)))


def averaged(
    image: np.ndarray, mask: np.ndarray, factor: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Downscale an image by averaging the light of the mask over each new pixel.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear light.
    mask : (H, W) bool ndarray
    factor : float
        New size over old size; from 1 the image keeps its size.

    Returns
    -------
    image : (h, w, 3) float32 ndarray
        0 outside the new mask.
    mask : (h, w) bool ndarray
        Pixels at least half covered by the mask; if there are none, all that it touches.
    factor : float
        The factor used.
    """
    if factor >= 1:
        return np.where(mask[..., None], image, 0).astype(np.float32), mask, 1.0
    area = AreaFilter.of(mask.shape, factor)
    cover = area(mask)
    inside = cover >= 0.5 * area.full
    inside = inside if inside.any() else cover > 0
    return (
        np.where(inside[..., None], resize_separately(image, mask, inside, area), 0),
        inside,
        factor,
    )


def resize_separately(
    image: np.ndarray, mask: np.ndarray, new_mask: np.ndarray, area: AreaFilter
) -> np.ndarray:
    """Downscale an image, averaging object and background separately.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    new_mask : (h, w) bool ndarray
        Its pixels average only the object, all others only the background.
    area : AreaFilter
        From the old grid to the new one.

    Returns
    -------
    (h, w, 3) float32 ndarray
    """
    result = np.empty((*new_mask.shape, 3), np.float32)
    lines = np.empty((2, image.shape[1], 4), np.float32)
    down, across = area.rows, area.columns
    _average_separately(
        np.asarray(image, np.float32),
        mask,
        new_mask,
        down.columns,
        down.weights,
        across.columns,
        across.weights,
        lines,
        result,
    )
    return result


@jit(types="f4[3:] b1[2:] b1[2:] i8[2] f4[2] i8[2] f4[2] f4[3] f4[3]")
def _average_separately(
    image, mask, new_mask, rows, row_weights, columns, column_weights, lines, result
):
    """Average down, then across.

    `lines` is memory for a row of the background and one of the object, each with its area.
    """
    width, zero = image.shape[1], np.float32(0)
    for i in range(result.shape[0]):
        lines[:] = zero
        for k in range(rows.shape[1]):
            weight = row_weights[i, k]
            if weight == 0:
                continue
            seen, kind = image[rows[i, k]], mask[rows[i, k]]
            for x in range(width):
                side = np.uint64(kind[x])
                lines[side, x, 0] += weight * seen[x, 0]
                lines[side, x, 1] += weight * seen[x, 1]
                lines[side, x, 2] += weight * seen[x, 2]
                lines[side, x, 3] += weight
        for j in range(result.shape[1]):
            line = lines[np.uint64(new_mask[i, j])]
            red, green, blue, share = zero, zero, zero, zero
            for k in range(columns.shape[1]):
                weight, at = column_weights[j, k], np.uint64(columns[j, k])
                red += weight * line[at, 0]
                green += weight * line[at, 1]
                blue += weight * line[at, 2]
                share += weight * line[at, 3]
            result[i, j, 0] = red / share if share > 0 else zero
            result[i, j, 1] = green / share if share > 0 else zero
            result[i, j, 2] = blue / share if share > 0 else zero
