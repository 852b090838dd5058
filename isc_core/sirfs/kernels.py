"""The SIRFS objective as compiled row kernels, with the formulas of `surface`, `reflectance` and
`illumination`.

Every loop runs over one-dimensional rows with few pointers, so that the compiler can emit vector
instructions; each kernel accepts float32 and float64. Arrays that belong together are passed as one
named tuple, which Numba unpacks at the call. Kernels release the interpreter lock and write only to
their own rows, hence the spill buffers: pairs reach two rows below a block, and those contributions
are added later, in a fixed order.
"""

# mypy: disable-error-code="no-untyped-def"
# (the compiler infers the types of every call)

from typing import NamedTuple

import numpy as np

from ..numerics.jit import IN_ORDER, REASSOCIATED, jit


class Photo(NamedTuple):
    """The image and where it is valid.

    Attributes
    ----------
    log_image : (H, C, W) ndarray
        Natural logarithm of the linear image.
    weight : (H, W) ndarray
        Per-pixel weight in [0, 1] of the reflectance terms, 0 where not valid.
    valid : (H, W) ndarray
        1 where the image is valid, else 0.
    spans : (H, 2) int64 ndarray
        First valid column of each row, and one past the last.
    """

    log_image: np.ndarray
    weight: np.ndarray
    valid: np.ndarray
    spans: np.ndarray


class Surface(NamedTuple):
    """The local geometry of the height map, and the slant term.

    Attributes
    ----------
    geometry : (H, 9, W) ndarray
        Rows zi zj zii zjj zij n1 n2 n3 and the mean curvature.
    slant_gradient : (H, W) ndarray
        Gradient of the slant term with respect to n3, unscaled.
    slant : (H,) ndarray
        Slant term of each row, unscaled.
    """

    geometry: np.ndarray
    slant_gradient: np.ndarray
    slant: np.ndarray


class Reflectance(NamedTuple):
    """Arrays of the reflectance in the space of the smoothness term and of the palette terms.

    Whitening matrices are (C, C); whitened log reflectances and their gradients are (H, C, W).
    """

    smoothness: np.ndarray
    palette: np.ndarray


class Pairs(NamedTuple):
    """The pairs of a smoothness term and its tabulated potential.

    Attributes
    ----------
    offsets : (K, 2) int64 ndarray
        Offset (down, right) of the second pixel of each pair, down >= 0.
    costs, rises : (M,) and (M - 1,) ndarray
        Cost at each node, and the difference to the next node.
    low, inverse_step : float
        Argument at the first node, and 1 / spacing of the nodes.
    """

    offsets: np.ndarray
    costs: np.ndarray
    rises: np.ndarray
    low: float
    inverse_step: float


class PairSums(NamedTuple):
    """What the blocks of a smoothness term write.

    Attributes
    ----------
    gradient : (H, ..., W) ndarray
        Gradient with respect to the differenced quantity, unscaled.
    spill : (B, 2, ..., W) ndarray
        What each block adds to the two rows below it.
    cost : (B,) ndarray
        Sum of each block, unscaled.
    """

    gradient: np.ndarray
    spill: np.ndarray
    cost: np.ndarray


class Grid(NamedTuple):
    """One axis of the table of absolute colour; all three are alike."""

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


class Pulls(NamedTuple):
    """Gradients that `backward_rows` carries on to the height and the light; unscaled.

    Attributes
    ----------
    smoothness, palette : (H, C, W) ndarray
        With respect to the whitened log reflectances.
    curvature : (H, W) ndarray
        With respect to the mean curvature.
    """

    smoothness: np.ndarray
    palette: np.ndarray
    curvature: np.ndarray


class Backward(NamedTuple):
    """What `backward_rows` writes.

    Attributes
    ----------
    light : (H, 9, C) ndarray
        Gradient with respect to the light of each row, as sums over monomials of the normal.
    derivatives : (5, H + 4, W + 4) ndarray
        Gradient with respect to zi, zj, zii, zjj and zij, with a zero border of two pixels; the
        last three are zero outside the spans.
    """

    light: np.ndarray
    derivatives: np.ndarray


# Types, see `numerics.kernel_types`.
_PHOTO = "Photo(r[3] r[2] r[2] i8[2])"
_SURFACE = "Surface(r[3] r[2] f8[1])"
_PAIRS = "Pairs(i8[2] r[1] r[1] f8 f8)"
_GRID = "Grid(f8 f8 f8 f8 i8)"
_CELLS = "Cells(i4[2] r[3])"


@jit(
    types=f"i8 i8 f8[2] {_PHOTO} r[2] Reflectance(r[2] r[2]) {_SURFACE} Reflectance(r[3] r[3])",
    math=IN_ORDER,
)
def forward_rows(first, last, padded, photo, light, whiten, surface, reflectance):
    """Compute the geometry, the whitened log reflectance and the slant term of rows [first, last).

    Differences of neighbouring heights are exact; reordering them would lose in float32 what the
    curvature needs, hence the mode `IN_ORDER`.

    Parameters
    ----------
    first, last : int
        Rows of this call.
    padded : (H + 2, W + 2) float64 ndarray
        Height with replicated borders, pixels.
    photo : Photo
    light : (9, C) ndarray
        Coefficients, already multiplied by the constants of the basis.
    whiten : Reflectance
        Whitening matrices.
    surface : Surface
        Output; curvature and second derivatives are written within the spans only.
    reflectance : Reflectance
        Output; whitened log reflectances, written within the spans only.
    """
    log_image, spans = photo.log_image, photo.spans
    geometry = surface.geometry
    t = geometry.dtype.type
    one, two, half = t(1), t(2), t(0.5)
    channels, width = log_image.shape[1], log_image.shape[2]
    soft = t(1e-4)
    a = np.empty((channels, width), geometry.dtype)
    for i in range(first, last):
        up, mid, low = padded[i], padded[i + 1], padded[i + 2]
        row = geometry[i]
        zi, zj, n1, n2, n3 = row[0], row[1], row[5], row[6], row[7]
        for j in range(width):
            zi[j] = (
                (low[j] - up[j]) + 2.0 * (low[j + 1] - up[j + 1]) + (low[j + 2] - up[j + 2])
            ) * 0.125
        for j in range(width):
            zj[j] = (
                (up[j + 2] - up[j]) + 2.0 * (mid[j + 2] - mid[j]) + (low[j + 2] - low[j])
            ) * 0.125
        for j in range(width):
            n3[j] = one / np.sqrt(one + zi[j] * zi[j] + zj[j] * zj[j])
        for j in range(width):
            n1[j] = -zi[j] * n3[j]
        for j in range(width):
            n2[j] = -zj[j] * n3[j]
        total = t(0)
        dslant = surface.slant_gradient[i]
        for j in range(width):
            x = -np.log(n3[j])
            root = np.sqrt(x * x + soft)
            total += root
            dslant[j] = -x / (root * n3[j])
        surface.slant[i] = total
        start, stop = spans[i, 0], spans[i, 1]
        count = stop - start
        if count <= 0:
            continue
        end = stop + 2
        up, mid, low = padded[i, start:end], padded[i + 1, start:end], padded[i + 2, start:end]
        zi, zj, zii = row[0, start:stop], row[1, start:stop], row[2, start:stop]
        zjj, zij, n1 = row[3, start:stop], row[4, start:stop], row[5, start:stop]
        n2, n3, k = row[6, start:stop], row[7, start:stop], row[8, start:stop]
        for j in range(count):
            left = (up[j] - mid[j]) + (low[j] - mid[j])
            centre = (up[j + 1] - mid[j + 1]) + (low[j + 1] - mid[j + 1])
            zii[j] = (
                left + 2.0 * centre + ((up[j + 2] - mid[j + 2]) + (low[j + 2] - mid[j + 2]))
            ) * 0.25
        for j in range(count):
            top = (up[j] - up[j + 1]) + (up[j + 2] - up[j + 1])
            centre = (mid[j] - mid[j + 1]) + (mid[j + 2] - mid[j + 1])
            zjj[j] = (
                top + 2.0 * centre + ((low[j] - low[j + 1]) + (low[j + 2] - low[j + 1]))
            ) * 0.25
        for j in range(count):
            zij[j] = ((low[j + 2] - low[j]) - (up[j + 2] - up[j])) * 0.25
        for j in range(count):
            k[j] = (
                (
                    (one + zi[j] * zi[j]) * zjj[j]
                    - two * zi[j] * zj[j] * zij[j]
                    + (one + zj[j] * zj[j]) * zii[j]
                )
                * (n3[j] * n3[j] * n3[j])
                * half
            )
        for c in range(channels):
            l0, l1, l2, l3, l4 = light[0, c], light[1, c], light[2, c], light[3, c], light[4, c]
            l5, l6, l7, l8 = light[5, c], light[6, c], light[7, c], light[8, c]
            ac, image = a[c], log_image[i, c, start:stop]
            for j in range(count):
                ac[j] = image[j] - (
                    l0
                    + n1[j] * (l3 + l4 * n2[j] + l7 * n3[j] + l8 * n1[j])
                    + n2[j] * (l1 + l5 * n3[j] - l8 * n2[j])
                    + n3[j] * (l2 + l6 * n3[j])
                )
        _mix(a[:, :count], whiten.smoothness, reflectance.smoothness[i, :, start:stop])
        _mix(a[:, :count], whiten.palette, reflectance.palette[i, :, start:stop])


@jit(math=REASSOCIATED, inline=True)
def _mix(source, matrix, target):
    """Write target[c] = sum_d matrix[c, d] source[d], row by row."""
    width = source.shape[1]
    if source.shape[0] == 1:
        for j in range(width):
            target[0, j] = matrix[0, 0] * source[0, j]
        return
    s0, s1, s2 = source[0], source[1], source[2]
    for c in range(3):
        m0, m1, m2 = matrix[c, 0], matrix[c, 1], matrix[c, 2]
        out = target[c]
        for j in range(width):
            out[j] = m0 * s0[j] + m1 * s1[j] + m2 * s2[j]


@jit(types=f"i8 i8 i8 r[3] {_PHOTO} {_PAIRS} PairSums(r[3] r[4] f8[1])", math=REASSOCIATED)
def smoothness_block(first, last, block, whitened, photo, pairs, out):
    """Compute the smoothness term of the pairs whose upper pixel lies in rows [first, last).

    Parameters
    ----------
    first, last, block : int
        Rows of this block, and its index.
    whitened : (H, C, W) ndarray
        Whitened log reflectance.
    photo : Photo
    pairs : Pairs
    out : PairSums
        Output; `gradient` is overwritten in these rows, `spill` and `cost` at `block`.
    """
    weight, spans = photo.weight, photo.spans
    offsets, table, rises = pairs.offsets, pairs.costs, pairs.rises
    gradient, spill = out.gradient, out.spill[block]
    t = whitened.dtype.type
    half, soft, zero = t(0.5), t(1e-8), t(0)
    inv, low_t = t(pairs.inverse_step), t(pairs.low)
    height, channels, width = whitened.shape
    last_cell = t(len(table) - 2)
    d = np.empty((channels, width), whitened.dtype)
    w = np.empty(width, whitened.dtype)
    s = np.empty(width, whitened.dtype)
    f = np.empty(width, whitened.dtype)
    cells = np.empty(width, np.int32)
    gradient[first:last] = zero
    spill[:] = zero
    cost = 0.0
    for i in range(first, last):
        for o in range(offsets.shape[0]):
            right, q = offsets[o, 1], i + offsets[o, 0]
            if q >= height:
                continue
            a, b = max(spans[i, 0], spans[q, 0] - right), min(spans[i, 1], spans[q, 1] - right)
            n = b - a
            if n <= 0:
                continue
            va, vb = weight[i, a:b], weight[q, a + right : b + right]
            for k in range(n):
                w[k] = va[k] * vb[k]
            for c in range(channels):
                p_row, q_row, dc = whitened[i, c, a:b], whitened[q, c, a + right : b + right], d[c]
                for k in range(n):
                    dc[k] = p_row[k] - q_row[k]
            part = zero
            if channels == 1:
                d0 = d[0]
                for k in range(n):
                    position = (d0[k] - low_t) * inv
                    cell = np.int32(max(zero, min(position, last_cell)))
                    base, rise = table[cell], rises[cell]
                    part += w[k] * (base + (position - t(cell)) * rise)
                    d0[k] = w[k] * rise
            else:
                d0, d1, d2 = d[0], d[1], d[2]
                for k in range(n):
                    s[k] = half * (d0[k] * d0[k] + d1[k] * d1[k] + d2[k] * d2[k])
                for k in range(n):
                    f[k] = np.sqrt(s[k] * s[k] + soft)
                for k in range(n):
                    s[k] = w[k] * s[k] / f[k]
                for k in range(n):
                    f[k] = (f[k] - low_t) * inv
                for k in range(n):
                    cells[k] = np.int32(min(f[k], last_cell))
                for k in range(n):
                    f[k] -= t(cells[k])
                for k in range(n):  # the table look-up keeps this loop from being vectorised
                    cell = cells[k]
                    rise = rises[cell]
                    part += w[k] * (table[cell] + f[k] * rise)
                    s[k] *= rise
                for k in range(n):
                    d0[k] *= s[k]
                for k in range(n):
                    d1[k] *= s[k]
                for k in range(n):
                    d2[k] *= s[k]
            cost += part
            for c in range(channels):
                dc, g = d[c], gradient[i, c, a:b]
                for k in range(n):
                    g[k] += dc[k]
                if q < last:
                    g = gradient[q, c, a + right : b + right]
                else:
                    g = spill[q - last, c, a + right : b + right]
                for k in range(n):
                    g[k] -= dc[k]
    out.cost[block] = cost


@jit(types=f"i8 i8 i8 r[3] {_PHOTO} {_PAIRS} PairSums(r[2] r[3] f8[1])", math=REASSOCIATED)
def curvature_block(first, last, block, geometry, photo, pairs, out):
    """Compute the curvature term of the pairs whose upper pixel lies in rows [first, last).

    Parameters
    ----------
    first, last, block : int
        Rows of this block, and its index.
    geometry : (H, 9, W) ndarray
        See `Surface`.
    photo : Photo
    pairs : Pairs
    out : PairSums
        Output, as in `smoothness_block`, without an axis of channels.
    """
    valid, spans = photo.valid, photo.spans
    offsets, table, rises = pairs.offsets, pairs.costs, pairs.rises
    gradient, spill = out.gradient, out.spill[block]
    t = geometry.dtype.type
    soft, zero, inv, low_t = t(1e-8), t(0), t(pairs.inverse_step), t(pairs.low)
    height, width = valid.shape
    last_cell = t(len(table) - 2)
    d = np.empty(width, geometry.dtype)
    w = np.empty(width, geometry.dtype)
    f = np.empty(width, geometry.dtype)
    cells = np.empty(width, np.int32)
    gradient[first:last] = zero
    spill[:] = zero
    cost = 0.0
    for i in range(first, last):
        for o in range(offsets.shape[0]):
            right, q = offsets[o, 1], i + offsets[o, 0]
            if q >= height:
                continue
            a, b = max(spans[i, 0], spans[q, 0] - right), min(spans[i, 1], spans[q, 1] - right)
            n = b - a
            if n <= 0:
                continue
            va, vb = valid[i, a:b], valid[q, a + right : b + right]
            for k in range(n):
                w[k] = va[k] * vb[k]
            p_row, q_row = geometry[i, 8, a:b], geometry[q, 8, a + right : b + right]
            for k in range(n):
                d[k] = p_row[k] - q_row[k]
            part = zero
            for k in range(n):
                f[k] = np.sqrt(d[k] * d[k] + soft)
            for k in range(n):
                d[k] = w[k] * d[k] / f[k]
            for k in range(n):
                f[k] = (f[k] - low_t) * inv
            for k in range(n):
                cells[k] = np.int32(min(f[k], last_cell))
            for k in range(n):
                f[k] -= t(cells[k])
            for k in range(n):
                cell = cells[k]
                rise = rises[cell]
                part += w[k] * (table[cell] + f[k] * rise)
                d[k] *= rise
            cost += part
            g = gradient[i, a:b]
            for k in range(n):
                g[k] += d[k]
            if q < last:
                g = gradient[q, a + right : b + right]
            else:
                g = spill[q - last, a + right : b + right]
            for k in range(n):
                g[k] -= d[k]
    out.cost[block] = cost


@jit(types=f"r[3] {_PHOTO} {_GRID} i8[2]", math=REASSOCIATED)
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
        See `Photo`.
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


@jit(types=f"{_PHOTO} {_CELLS} f8[3]", math=REASSOCIATED)
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
    right, down = counts.shape[2], counts.shape[1] * counts.shape[2]
    flat = counts.reshape(counts.size)
    for i in range(weight.shape[0]):
        for j in range(spans[i, 0], spans[i, 1]):
            if weight[i, j] == 0:
                continue
            k = cell[i, j]
            x, y, z = float(side[i, 0, j]), float(side[i, 1, j]), float(side[i, 2, j])
            share = float(weight[i, j])
            x0, y0, x = share * (1 - x), 1 - y, share * x
            p00, p01, p10, p11 = x0 * y0, x0 * y, x * y0, x * y
            flat[k] += p00 * (1 - z)
            flat[k + 1] += p00 * z
            flat[k + right] += p01 * (1 - z)
            flat[k + right + 1] += p01 * z
            flat[k + down] += p10 * (1 - z)
            flat[k + down + 1] += p10 * z
            flat[k + down + right] += p11 * (1 - z)
            flat[k + down + right + 1] += p11 * z


@jit(types=f"r[3] {_PHOTO} {_GRID} {_CELLS} r[3] r[3]", math=REASSOCIATED)
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
    right, down = node_gradient.shape[2], node_gradient.shape[1] * node_gradient.shape[2]
    flat = node_gradient.reshape(node_gradient.size)
    for i in range(palette.shape[0]):
        gx_row, gy_row, gz_row = gradient[i, 0], gradient[i, 1], gradient[i, 2]
        for j in range(spans[i, 0], spans[i, 1]):
            if weight[i, j] == 0:
                continue
            k, share = cell[i, j], inv * weight[i, j]
            x, y, z = side[i, 0, j], side[i, 1, j], side[i, 2, j]
            g000, g001, g010, g011 = flat[k], flat[k + 1], flat[k + right], flat[k + right + 1]
            k += down
            g100, g101, g110, g111 = flat[k], flat[k + 1], flat[k + right], flat[k + right + 1]
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
    """Blur the node counts along each axis, zero padded, only where it can matter.

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


@jit(types="i8 i8 r[3] r[3] r[2] r[3] f8[1]", math=REASSOCIATED)
def normals_rows(first, last, geometry, expected, strength, gradient, sums):
    """Compute a term of expected normals in rows [first, last).

    Parameters
    ----------
    first, last : int
        Rows of this call.
    geometry : (H, 9, W) ndarray
        See `Surface`.
    expected : (2, H, W) ndarray
        Expected n1 and n2.
    strength : (H, W) ndarray
        See `precision.strength_of`.
    gradient : (2, H, W) ndarray
        Gradients with respect to n1 and n2, which grow by those of this term.
    sums : (H,) ndarray
        Output: the term of each row.
    """
    t = geometry.dtype.type
    half = t(0.5)
    for i in range(first, last):
        n1, n2, m1, m2, s = (
            geometry[i, 5],
            geometry[i, 6],
            expected[0, i],
            expected[1, i],
            strength[i],
        )
        g1, g2 = gradient[0, i], gradient[1, i]
        for j in range(len(s)):
            g1[j] += s[j] * (n1[j] - m1[j])
        for j in range(len(s)):
            g2[j] += s[j] * (n2[j] - m2[j])
        total = t(0)
        for j in range(len(s)):
            away1, away2 = n1[j] - m1[j], n2[j] - m2[j]
            total += s[j] * (away1 * away1 + away2 * away2)
        sums[i] = half * total


@jit(
    types=f"i8 i8 {_SURFACE} i8[2] r[2] Reflectance(r[2] r[2]) Pulls(r[3] r[3] r[2]) (f8 f8 f8 "
    "f8) r[3] Backward(f8[3] r[3])",
    math=REASSOCIATED,
)
def backward_rows(first, last, surface, spans, light, whiten, pulls, scales, in_plane, out):
    """Compute the gradients with respect to the height's derivatives and the light.

    Parameters
    ----------
    first, last : int
        Rows of this call.
    surface : Surface
    spans : (H, 2) int64 ndarray
        See `Photo`.
    light : (9, C) ndarray
        As in `forward_rows`.
    whiten : Reflectance
        Whitening matrices.
    pulls : Pulls
        Gradients with respect to the whitened log reflectances and the curvature.
    scales : tuple of float
        Factors of the smoothness, palette, curvature and slant gradients.
    in_plane : (2, H, W) ndarray
        Gradients of the terms of contour and expected normals with respect to n1 and n2.
    out : Backward
        Output.
    """
    geometry, light_sums = surface.geometry, out.light
    g_smooth, g_palette, g_curvature = pulls.smoothness, pulls.palette, pulls.curvature
    t = geometry.dtype.type
    two, three = t(2), t(3)
    channels, width = g_smooth.shape[1], g_smooth.shape[2]
    k_smooth, k_palette = t(scales[0]), t(scales[1])
    k_curvature, k_slant = t(scales[2]), t(scales[3])
    m_smooth, m_palette = whiten.smoothness.T * k_smooth, whiten.palette.T * k_palette
    shape = (channels, width)
    e_all, f_all = np.empty(shape, geometry.dtype), np.empty(shape, geometry.dtype)
    d1_all, d2_all, dn3_all = (
        np.empty(width, geometry.dtype),
        np.empty(width, geometry.dtype),
        np.empty(width, geometry.dtype),
    )
    along_all, dk_all = np.empty(width, geometry.dtype), np.empty(width, geometry.dtype)
    for i in range(first, last):
        row = geometry[i]
        start, stop = spans[i, 0], spans[i, 1]
        count = stop - start
        c1, c2, slant = in_plane[0, i], in_plane[1, i], surface.slant_gradient[i]
        for j in range(width):
            d1_all[j] = c1[j]
        for j in range(width):
            d2_all[j] = c2[j]
        for j in range(width):
            dn3_all[j] = slant[j] * k_slant
        if count > 0:
            n1, n2, n3 = row[5, start:stop], row[6, start:stop], row[7, start:stop]
            d1, d2, dn3 = d1_all[start:stop], d2_all[start:stop], dn3_all[start:stop]
            e, f = e_all[:, :count], f_all[:, :count]
            _mix(g_smooth[i, :, start:stop], m_smooth, e)
            _mix(g_palette[i, :, start:stop], m_palette, f)
            for c in range(channels):
                ec, fc = e[c], f[c]
                for j in range(count):
                    ec[j] = -(ec[j] + fc[j])  # gradient of the log shading
                _light_sums(ec, n1, n2, n3, light_sums[i, :, c])
                l1, l2, l3, l4 = light[1, c], light[2, c], light[3, c], light[4, c]
                l5, l6, l7, l8 = light[5, c], light[6, c], light[7, c], light[8, c]
                for j in range(count):
                    d1[j] += ec[j] * (l3 + l4 * n2[j] + l7 * n3[j] + two * l8 * n1[j])
                for j in range(count):
                    d2[j] += ec[j] * (l1 + l4 * n1[j] + l5 * n3[j] - two * l8 * n2[j])
                for j in range(count):
                    dn3[j] += ec[j] * (l2 + l5 * n2[j] + l7 * n1[j] + two * l6 * n3[j])
        else:
            light_sums[i] = 0.0
        zi, zj, n3 = row[0], row[1], row[7]
        for j in range(width):
            along_all[j] = zi[j] * d1_all[j] + zj[j] * d2_all[j] - dn3_all[j]
        for j in range(width):
            along_all[j] = along_all[j] * n3[j] * n3[j] * n3[j]
        if count > 0:
            gk, curved, n3 = g_curvature[i, start:stop], row[8, start:stop], row[7, start:stop]
            dk, along = dk_all[:count], along_all[start:stop]
            for j in range(count):
                dk[j] = gk[j] * k_curvature
            for j in range(count):
                along[j] -= three * curved[j] * n3[j] * n3[j] * dk[j]
            for j in range(count):
                dk[j] = dk[j] * n3[j] * n3[j] * n3[j]
        n3 = row[7]
        down = out.derivatives[0, i + 2, 2 : width + 2]
        right = out.derivatives[1, i + 2, 2 : width + 2]
        for j in range(width):
            down[j] = zi[j] * along_all[j] - n3[j] * d1_all[j]
        for j in range(width):
            right[j] = zj[j] * along_all[j] - n3[j] * d2_all[j]
        if count > 0:
            _curvature_derivatives(
                row[:, start:stop],
                dk_all[:count],
                out.derivatives[:, i + 2, start + 2 : stop + 2],
            )


@jit(math=REASSOCIATED, inline=True)
def _curvature_derivatives(row, dk, out):
    """Add the gradient of the curvature, dk (W,) times n3^3, to those of the derivatives.

    `out` is (5, W); its last three rows are overwritten.
    """
    t = row.dtype.type
    one, half = t(1), t(0.5)
    zi, zj, zii, zjj, zij = row[0], row[1], row[2], row[3], row[4]
    count = len(dk)
    cross = np.empty(count, row.dtype)
    for j in range(count):
        cross[j] = dk[j] * (zi[j] * zjj[j] - zj[j] * zij[j])
    o = out[0]
    for j in range(count):
        o[j] += cross[j]
    for j in range(count):
        cross[j] = dk[j] * (zj[j] * zii[j] - zi[j] * zij[j])
    o = out[1]
    for j in range(count):
        o[j] += cross[j]
    o = out[2]
    for j in range(count):
        o[j] = half * dk[j] * (one + zj[j] * zj[j])
    o = out[3]
    for j in range(count):
        o[j] = half * dk[j] * (one + zi[j] * zi[j])
    o = out[4]
    for j in range(count):
        o[j] = -dk[j] * zi[j] * zj[j]


@jit(math=REASSOCIATED, inline=True)
def _light_sums(d, n1, n2, n3, sums):
    """Write the sums of d times 1, n2, n3, n1, n1 n2, n2 n3, n3^2, n1 n3, n1^2 - n2^2."""
    t = d.dtype.type
    s0, s1, s2, s3, s4, s5, s6, s7, s8 = t(0), t(0), t(0), t(0), t(0), t(0), t(0), t(0), t(0)
    for j in range(len(d)):
        a, b, c = d[j] * n1[j], d[j] * n2[j], d[j] * n3[j]
        s0 += d[j]
        s1 += b
        s2 += c
        s3 += a
        s4 += a * n2[j]
        s5 += b * n3[j]
        s6 += c * n3[j]
        s7 += a * n3[j]
        s8 += a * n1[j] - b * n2[j]
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8] = (
        s0,
        s1,
        s2,
        s3,
        s4,
        s5,
        s6,
        s7,
        s8,
    )


@jit(types="i8 i8 r[3] r[2]", math=REASSOCIATED)
def adjoint_rows(first, last, d, wide):
    """Compute rows [first, last) of the gradient of the padded height.

    Parameters
    ----------
    first, last : int
        Rows of this call.
    d : (5, H + 4, W + 4) ndarray
        Gradients of the five derivatives, with a zero border.
    wide : (H + 2, W + 2) ndarray
        Output.
    """
    t = wide.dtype.type
    two, quarter, eighth = t(2), t(0.25), t(0.125)
    width = d.shape[2]
    p = np.empty(width, wide.dtype)
    q = np.empty(width, wide.dtype)
    r = np.empty(width, wide.dtype)
    for i in range(first, last):
        below, here, above = (
            d[:, i],
            d[:, i + 1],
            d[:, i + 2],
        )  # sources whose stencil has this row below, at, above its centre
        b0, b1, b2, b3, b4 = below[0], below[1], below[2], below[3], below[4]
        h1, h2, h3 = here[1], here[2], here[3]
        a0, a1, a2, a3, a4 = above[0], above[1], above[2], above[3], above[4]
        for j in range(width):
            p[j] = (b0[j] - a0[j]) * eighth + (b2[j] - two * h2[j] + a2[j]) * quarter
        for j in range(width):
            q[j] = (b1[j] + two * h1[j] + a1[j]) * eighth + (b4[j] - a4[j]) * quarter
        for j in range(width):
            r[j] = (b3[j] + two * h3[j] + a3[j]) * quarter
        out = wide[i]
        for j in range(width - 2):
            out[j] = (
                p[j]
                + two * p[j + 1]
                + p[j + 2]
                + q[j]
                - q[j + 2]
                + r[j]
                - two * r[j + 1]
                + r[j + 2]
            )
