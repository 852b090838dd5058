"""Terms over pairs of nearby pixels: smoothness of the reflectance, and of the curvature.

Pairs reach two rows below a block of rows. These contributions go to buffers of the block and are
added later, in a fixed order.
"""

# mypy: disable-error-code="no-untyped-def"
# (the compiler infers the types of every call)

from typing import NamedTuple

import numpy as np

from ...numerics.jit import REASSOCIATED, jit
from . import arrays

# Type, see `numerics.kernel_types`.
_PAIRS = "Pairs(i8[2] r[1] r[1] f8 f8)"


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
    """Output of the blocks of a smoothness term.

    Attributes
    ----------
    gradient : (H, ..., W) ndarray
        Gradient with respect to the differenced quantity, unscaled.
    spill : (B, 2, ..., W) ndarray
        Contributions of each block to the two rows below it.
    cost : (B,) ndarray
        Sum of each block, unscaled.
    """

    gradient: np.ndarray
    spill: np.ndarray
    cost: np.ndarray


@jit(types=f"i8 i8 i8 r[3] {arrays.PHOTO} {_PAIRS} PairSums(r[3] r[4] f8[1])", math=REASSOCIATED)
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
            a, b = _shared_columns(spans, i, q, right)
            n = b - a
            if n <= 0:
                continue
            _multiply(weight[i, a:b], weight[q, a + right : b + right], w)
            for c in range(channels):
                _subtract(whitened[i, c, a:b], whitened[q, c, a + right : b + right], d[c])
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
                    root = np.sqrt(s[k] * s[k] + soft)
                    f[k] = root
                    s[k] = w[k] * s[k] / root
                part = _tabulated(f[:n], w, pairs, cells, s)
                for k in range(n):
                    d0[k] *= s[k]
                for k in range(n):
                    d1[k] *= s[k]
                for k in range(n):
                    d2[k] *= s[k]
            cost += part
            for c in range(channels):
                if q < last:
                    lower = gradient[q, c, a + right : b + right]
                else:
                    lower = spill[q - last, c, a + right : b + right]
                _add_to_pair(d[c], gradient[i, c, a:b], lower)
    out.cost[block] = cost


@jit(types=f"i8 i8 i8 r[3] {arrays.PHOTO} {_PAIRS} PairSums(r[2] r[3] f8[1])", math=REASSOCIATED)
def curvature_block(first, last, block, geometry, photo, pairs, out):
    """Compute the curvature term of the pairs whose upper pixel lies in rows [first, last).

    Parameters
    ----------
    first, last, block : int
        Rows of this block, and its index.
    geometry : (H, 9, W) ndarray
        See `arrays.Surface`.
    photo : Photo
    pairs : Pairs
    out : PairSums
        Output, as in `smoothness_block`, without an axis of channels.
    """
    valid, spans = photo.valid, photo.spans
    offsets = pairs.offsets
    gradient, spill = out.gradient, out.spill[block]
    t = geometry.dtype.type
    soft, zero = t(1e-8), t(0)
    height, width = valid.shape
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
            a, b = _shared_columns(spans, i, q, right)
            n = b - a
            if n <= 0:
                continue
            _multiply(valid[i, a:b], valid[q, a + right : b + right], w)
            _subtract(geometry[i, 8, a:b], geometry[q, 8, a + right : b + right], d)
            for k in range(n):
                root = np.sqrt(d[k] * d[k] + soft)
                f[k] = root
                d[k] = w[k] * d[k] / root
            cost += _tabulated(f[:n], w, pairs, cells, d)
            if q < last:
                lower = gradient[q, a + right : b + right]
            else:
                lower = spill[q - last, a + right : b + right]
            _add_to_pair(d, gradient[i, a:b], lower)
    out.cost[block] = cost


@jit(math=REASSOCIATED, inline=True)
def _shared_columns(spans, i, q, right):
    """First column, and one past the last, in which pixels of rows i and q form pairs."""
    return max(spans[i, 0], spans[q, 0] - right), min(spans[i, 1], spans[q, 1] - right)


@jit(math=REASSOCIATED, inline=True)
def _multiply(upper, lower, out):
    for k in range(len(upper)):
        out[k] = upper[k] * lower[k]


@jit(math=REASSOCIATED, inline=True)
def _subtract(upper, lower, out):
    for k in range(len(upper)):
        out[k] = upper[k] - lower[k]


@jit(math=REASSOCIATED, inline=True)
def _tabulated(f, weight, pairs, cells, slope):
    """Return the weighted sum of the potential at f, and multiply `slope` by its derivative.

    `f` and `cells` are overwritten.
    """
    t = f.dtype.type
    table, rises = pairs.costs, pairs.rises
    inv, low, last_cell = t(pairs.inverse_step), t(pairs.low), t(len(table) - 2)
    count, cost = len(f), t(0)
    for k in range(count):
        position = (f[k] - low) * inv
        cell = np.int32(min(position, last_cell))
        cells[k] = cell
        f[k] = position - t(cell)
    for k in range(count):  # the table look-up keeps this loop from being vectorised
        place = np.uint32(cells[k])  # without a sign: no test for an index from the end
        rise = rises[place]
        cost += weight[k] * (table[place] + f[k] * rise)
        slope[k] *= rise
    return cost


@jit(math=REASSOCIATED, inline=True)
def _add_to_pair(d, upper, lower):
    """Add the gradient d to the upper pixels of pairs, and subtract it from the lower ones."""
    for k in range(len(upper)):
        upper[k] += d[k]
    for k in range(len(lower)):
        lower[k] -= d[k]
