"""Upsampling of block averages: bilinear or cubic between the centres of the blocks.

Equation: pixel k of a row lies at x = (k + 1/2) / f - 1/2 of the averages, each f pixels wide;
beyond the outermost centres their value is repeated. With t = x - floor(x), the cubic kernel weighs
the four nearest centres by

    (-t + 2 t^2 - t^3) / 2,   (2 - 5 t^2 + 3 t^3) / 2,   (t + 4 t^2 - 3 t^3) / 2,   (t^3 - t^2) / 2,

which passes through the averages and has continuous derivatives.

Citation: P. Heckbert, "What are the coordinates of a pixel?", Graphics Gems (1990), 246-248;
R. Keys, "Cubic convolution interpolation for digital image processing", IEEE Transactions on
Acoustics, Speech, and Signal Processing 29 (1981), 1153-1160, doi:10.1109/TASSP.1981.1163711.

Limits: next to a step, the cubic kernel exceeds the averages by up to 7 % of the step.
"""

import numpy as np

from .row_blocks import row_blocks


def enlarged(
    layer: np.ndarray,
    shape: tuple[int, ...],
    factor: float,
    start: tuple[int, ...] = (0, 0),
) -> np.ndarray:
    """Upsample a map of block averages.

    Parameters
    ----------
    layer : (h, w) or (h, w, C) ndarray
        The averages.
    shape : tuple of int
        (H, W) of the result.
    factor : float
        Width and height of a block in pixels, at least 1.
    start : tuple of int
        Row and column of the first pixel, for a part of the result.

    Returns
    -------
    (H, W) or (H, W, C) ndarray
    """
    for axis, (size, first_pixel) in enumerate(zip(shape, start, strict=True)):
        place = (np.arange(first_pixel, first_pixel + size) + 0.5) / factor - 0.5
        at = np.clip(place, 0, layer.shape[axis] - 1)
        first = np.minimum(at.astype(np.int64), max(layer.shape[axis] - 2, 0))
        beyond = (
            (at - first)
            .astype(np.float32)
            .reshape([-1 if k == axis else 1 for k in range(layer.ndim)])
        )
        after = np.minimum(first + 1, layer.shape[axis] - 1)
        layer = (1 - beyond) * np.take(layer, first, axis) + beyond * np.take(layer, after, axis)
    return layer


def enlarged_cubically(
    layer: np.ndarray, shape: tuple[int, ...], rows: slice | None = None
) -> np.ndarray:
    """Upsample a map to the size of another one over the same frame, without its creases.

    Parameters
    ----------
    layer : (h, w) or (h, w, C) ndarray
        The averages.
    shape : tuple of int
        (H, W) of the whole result.
    rows : slice, optional
        Of the result; all by default.

    Returns
    -------
    (H, W) or (H, W, C) ndarray
        `layer` itself, if it has that size.
    """
    rows = rows or slice(0, shape[0])
    for axis, part in enumerate((rows, slice(0, shape[1]))):
        have, size = layer.shape[axis], shape[axis]
        if have == size:
            layer = np.take(layer, np.arange(part.start, part.stop), axis)
            continue
        place = (np.arange(part.start, part.stop) + 0.5) * have / size - 0.5
        at = np.clip(place, 0, have - 1)
        first = at.astype(np.int64)
        t = at - first
        weights = (
            (-t + 2 * t**2 - t**3) / 2,
            (2 - 5 * t**2 + 3 * t**3) / 2,
            (t + 4 * t**2 - 3 * t**3) / 2,
            (t**3 - t**2) / 2,
        )
        column = [-1 if k == axis else 1 for k in range(layer.ndim)]
        lengths = [len(place) if k == axis else n for k, n in enumerate(layer.shape)]
        total = np.zeros(lengths, np.result_type(layer, np.float32))
        for k, weight in enumerate(weights, -1):
            near = np.take(layer, np.clip(first + k, 0, have - 1), axis)
            total += weight.astype(np.float32).reshape(column) * near
        layer = total
    return layer


def enlarge_inside(layer: np.ndarray, inside: np.ndarray, factor: float, out: np.ndarray) -> None:
    """Upsample a map inside a mask, in blocks of rows.

    Parameters
    ----------
    layer : (h, w, C) ndarray
        The averages.
    inside : (H, W) bool ndarray
    factor : float
        As for `enlarged`.
    out : (H, W, C) ndarray
        Receives the map inside the mask, 0 elsewhere.
    """
    same = factor == 1 and layer.shape[:2] == inside.shape
    for block in row_blocks(inside.shape):
        rows, part = block.rows, inside[block.rows]
        fine = layer[rows] if same else enlarged(layer, part.shape, factor, (rows.start, 0))
        out[rows] = np.where(part[..., None], fine, 0)
