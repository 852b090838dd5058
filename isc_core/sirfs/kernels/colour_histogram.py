"""The palette terms (parsimony, absolute): histogram of the colours, its blur, and the gradient.

Only the occupied part of the grid of colours is stored.
"""

# mypy: disable-error-code="no-untyped-def"
# (the compiler infers the types of every call)

from typing import NamedTuple

import numpy as np

from ...numerics.jit import REASSOCIATED, jit
from . import arrays

# Types, see `numerics.kernel_types`.
_GRID = "Grid(f8 f8 f8 f8 i8)"
_CELLS = "Cells(i4[2] r[3])"


class Grid(NamedTuple):
    """One axis of the table of absolute colour; all three are equal."""

    low: float
    high: float
    step: float
    inverse_step: float
    nodes: int


class Cells(NamedTuple):
    """Where every pixel falls on the occupied part of the colour grid.

    Attributes
    ----------
    node : (H, W) int32 ndarray
        Flat index of the cell's first node.
    side : (H, 3, W) ndarray
        Position in the cell, in [0, 1].
    """

    node: np.ndarray
    side: np.ndarray


@jit(types=f"r[3] {arrays.PHOTO} {_GRID} i8[2]", math=REASSOCIATED)
def palette_range(palette, photo, grid, bounds):
    """Find the occupied part of the colour grid.

    Parameters
    ----------
    palette : (H, 3, W) ndarray
        Log reflectance, whitened for the palette terms.
    photo : Photo
    grid : Grid
    bounds : (3, 2) int64 ndarray
        Output: the first occupied node of each axis, and one past the last.
    """
    weight, spans = photo.weight, photo.spans
    low, step, nodes = grid.low, grid.step, grid.nodes
    height, channels, _ = palette.shape
    t = palette.dtype.type
    for c in range(channels):
        least, most = t(1e30), t(-1e30)
        for i in range(height):
            row = palette[i, c]
            for j in range(spans[i, 0], spans[i, 1]):
                if weight[i, j] > t(0):
                    least, most = min(least, row[j]), max(most, row[j])
        first = min(max((least - low) / step, 0.0), nodes - 1.0)
        final = min(max((most - low) / step, 0.0), nodes - 1.0)
        bounds[c, 0] = min(int(first), nodes - 2)
        bounds[c, 1] = min(int(final), nodes - 2) + 2


@jit(types=f"r[3] i8[2] {_GRID} i8[2] {_CELLS}", math=REASSOCIATED)
def locate_color(palette, spans, grid, bounds, cells):
    """Find where every pixel falls on the occupied part of the colour grid.

    Parameters
    ----------
    palette : (H, 3, W) ndarray
        Log reflectance, whitened for the palette terms.
    spans : (H, 2) int64 ndarray
        See `arrays.Photo`.
    grid : Grid
    bounds : (3, 2) int64 ndarray
        See `palette_range`.
    cells : Cells
        Output.
    """
    low, inverse_step, nodes = grid.low, grid.inverse_step, grid.nodes
    cell, side = cells.node, cells.side
    sizes = bounds[:, 1] - bounds[:, 0]
    strides = (sizes[1] * sizes[2], sizes[2], 1)
    t = side.dtype.type
    top, last_cell = nodes - 1.0, nodes - 2.0
    for i in range(palette.shape[0]):
        a, b = spans[i, 0], spans[i, 1]
        flat = cell[i, a:b]
        flat[:] = 0
        for c in range(3):
            values, place = palette[i, c, a:b], side[i, c, a:b]
            first, stride = bounds[c, 0], strides[c]
            for j in range(b - a):
                position = min(max((values[j] - low) * inverse_step, 0.0), top)
                whole = np.int64(min(position, last_cell))
                place[j] = t(position - whole)
                flat[j] += (whole - first) * stride


@jit(types=f"{arrays.PHOTO} {_CELLS} f8[3]", math=REASSOCIATED)
def splat_color(photo, cells, counts):
    """Add every pixel's weight to the eight nodes around its whitened log colour.

    Parameters
    ----------
    photo : Photo
    cells : Cells
    counts : (A, B, N) float64 ndarray
        Changed in place.
    """
    weight, spans = photo.weight, photo.spans
    cell, side = cells.node, cells.side
    # Indices without a sign need no test for an index from the end.
    right, down = np.uint64(counts.shape[2]), np.uint64(counts.shape[1] * counts.shape[2])
    one = np.uint64(1)
    flat = counts.reshape(counts.size)
    for i in range(weight.shape[0]):
        for j in range(spans[i, 0], spans[i, 1]):
            if weight[i, j] == 0:
                continue
            k = np.uint64(cell[i, j])
            x, y, z = float(side[i, 0, j]), float(side[i, 1, j]), float(side[i, 2, j])
            share = float(weight[i, j])
            x0, y0, x = share * (1 - x), 1 - y, share * x
            p00, p01, p10, p11 = x0 * y0, x0 * y, x * y0, x * y
            flat[k] += p00 * (1 - z)
            flat[k + one] += p00 * z
            flat[k + right] += p01 * (1 - z)
            flat[k + right + one] += p01 * z
            flat[k + down] += p10 * (1 - z)
            flat[k + down + one] += p10 * z
            flat[k + down + right] += p11 * (1 - z)
            flat[k + down + right + one] += p11 * z


@jit(types=f"r[3] {arrays.PHOTO} {_GRID} {_CELLS} r[3] r[3]", math=REASSOCIATED)
def gather_color(palette, photo, grid, cells, node_gradient, gradient):
    """Compute the gradient of the whitened log colours from that of the node counts.

    Parameters
    ----------
    palette : (H, 3, W) ndarray
        Log reflectance, whitened for the palette terms.
    photo : Photo
    grid : Grid
    cells : Cells
    node_gradient : (A, B, N) ndarray
    gradient : (H, 3, W) ndarray
        Output, written within the spans; 0 where a colour lies off the grid.
    """
    weight, spans = photo.weight, photo.spans
    low, high = grid.low, grid.high
    cell, side = cells.node, cells.side
    t = gradient.dtype.type
    inv = t(grid.inverse_step)
    right = np.uint64(node_gradient.shape[2])  # without a sign, as in `splat_color`
    down = np.uint64(node_gradient.shape[1] * node_gradient.shape[2])
    one = np.uint64(1)
    flat = node_gradient.reshape(node_gradient.size)
    for i in range(palette.shape[0]):
        gx_row, gy_row, gz_row = gradient[i, 0], gradient[i, 1], gradient[i, 2]
        for j in range(spans[i, 0], spans[i, 1]):
            if weight[i, j] == 0:
                continue
            k, share = np.uint64(cell[i, j]), inv * weight[i, j]
            x, y, z = side[i, 0, j], side[i, 1, j], side[i, 2, j]
            g000, g001, g010, g011 = flat[k], flat[k + one], flat[k + right], flat[k + right + one]
            k += down
            g100, g101, g110, g111 = flat[k], flat[k + one], flat[k + right], flat[k + right + one]
            d00, d01, d10, d11 = g001 - g000, g011 - g010, g101 - g100, g111 - g110
            e00, e01, e10, e11 = g000 + z * d00, g010 + z * d01, g100 + z * d10, g110 + z * d11
            f0, f1 = e01 - e00, e11 - e10
            gx_row[j] = share * ((e10 + y * f1) - (e00 + y * f0))
            gy_row[j] = share * (f0 + x * (f1 - f0))
            h0, h1 = d00 + y * (d01 - d00), d10 + y * (d11 - d10)
            gz_row[j] = share * (h0 + x * (h1 - h0))
        for c in range(3):
            values, out = palette[i, c], gradient[i, c]
            for j in range(spans[i, 0], spans[i, 1]):
                if values[j] < low or values[j] > high:
                    out[j] = t(0)


@jit(types="f8[3] f8[1] f8[3]", math=REASSOCIATED)
def blur_color(counts, taps, blurred):
    """Blur the node counts along each axis, zero padded, computed at occupied nodes only.

    Parameters
    ----------
    counts : (A, B, N) float64 ndarray
    taps : (2 k + 1,) ndarray
    blurred : (A, B, N) float64 ndarray
        Output; correct on occupied rows, 0 elsewhere.
    """
    size_a, size_b, size_c = counts.shape
    half = len(taps) // 2
    occupied = np.zeros((size_a, size_b), np.bool_)
    along_c = np.zeros_like(counts)
    for a in range(size_a):
        for b in range(size_b):
            source, target = counts[a, b], along_c[a, b]
            for c in range(size_c):
                if source[c] != 0:
                    occupied[a, b] = True
                    value = source[c]
                    start = max(0, c - half)
                    stop = min(size_c, c + half + 1)
                    shift = half - c
                    for k in range(start, stop):
                        target[k] += value * taps[k + shift]
    along_b = np.zeros_like(counts)
    reached = np.zeros((size_a, size_b), np.bool_)
    for a in range(size_a):
        for b in range(size_b):
            if not occupied[a, b]:
                continue
            source = along_c[a, b]
            for k in range(max(0, b - half), min(size_b, b + half + 1)):
                reached[a, k] = True
                target, tap = along_b[a, k], taps[k - b + half]
                for c in range(size_c):
                    target[c] += source[c] * tap
    for a in range(size_a):
        for b in range(size_b):
            target = blurred[a, b]
            target[:] = 0
            if not occupied[a, b]:
                continue
            for k in range(max(0, a - half), min(size_a, a + half + 1)):
                if not reached[k, b]:
                    continue
                source, tap = along_b[k, b], taps[a - k + half]
                for c in range(size_c):
                    target[c] += source[c] * tap
