"""Convolution with a 3 x 3 kernel, whose result is identical on any number of threads.

Equation: y[p, o] = b[o] + sum_t sum_c w[t, c, o] x[p + t, c], over the nine offsets t and all
channels c, in this order; x is zero outside the map.

Compiled, the products are summed in float32, eight channels at a time, for all outputs of a pixel
at once. Without a compiler they are matrix products of neighbourhoods, whose order of summation
depends on the library and its threads. There, both factors are rounded to integer multiples of a
power of two, such that float64 represents every sum of their products exactly: its order does not
affect the result.

Limits: on one thread; designed for networks of up to a few million weights. A library such as
onnxruntime cannot be shipped in a Blender extension for all versions, and its order of summation is
not defined.
"""

import numpy as np

from ..numerics.jit import IN_ORDER, compiled_available, jit

_TOGETHER = 8  # channels that the compiled loop adds at a time
_BITS = 20  # of the largest factor: 9 x 1024 products of twice as many bits sum to less than 2^53
_SIGN_AND_NUMBER = np.int32(-0x70000001)  # without the three bits between them
_BLOCK_BYTES = 4_000_000  # of the neighbourhoods that are processed at a time


def convolved(layers: np.ndarray, weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Convolve the maps of some photos with a 3 x 3 kernel and zero padding.

    Parameters
    ----------
    layers : (N, H, W, C) ndarray
        One map for each photo; no result depends on the others.
    weight : (9, C, D) ndarray
        Kernels in row-major order; float16, too.
    bias : (D,) ndarray

    Returns
    -------
    (N, H, W, D) float32 ndarray
    """
    weight = single(weight)
    if not compiled_available():
        return np.stack([_exact_products(layer, weight, bias) for layer in layers])
    photos, rows, columns, channels = layers.shape
    missing = -channels % _TOGETHER
    if missing:
        weight = np.pad(weight, ((0, 0), (0, missing), (0, 0)))
    padded = np.zeros((rows + 2, columns + 2, channels + missing), np.float32)
    found = np.empty((photos, rows, columns, weight.shape[2]), np.float32)
    found[:] = bias
    for layer, sums in zip(layers, found, strict=True):
        padded[1:-1, 1:-1, :channels] = layer
        _add_products(padded, weight, sums)
    return found


def single(values: np.ndarray) -> np.ndarray:
    """Convert to float32, faster than NumPy does from float16.

    NumPy converts numbers of 16 bits one by one. Shifted to the place of their exponent, they are
    the number times 2^-112.

    Parameters
    ----------
    values : ndarray
        Finite.

    Returns
    -------
    float32 ndarray
        Contiguous.
    """
    if values.dtype != np.float16:
        return np.ascontiguousarray(values, np.float32)
    bits = values.view(np.int16).astype(np.int32, order="C")  # which extends the sign
    bits <<= 13
    bits &= _SIGN_AND_NUMBER
    found = bits.view(np.float32)
    found *= np.float32(2.0**112)
    return found


@jit(types="f4[3] f4[3] f4[3]", math=IN_ORDER)
def _add_products(padded: np.ndarray, weight: np.ndarray, sums: np.ndarray) -> None:
    """Add the products of a map, padded by one pixel, and a kernel (9, C, D) to `sums`; C is a
    multiple of eight.

    The weights of eight channels are used for a row of pixels, so that they and the sums of the row
    stay in the fastest cache.
    """
    rows, columns, outputs = sums.shape
    for y in range(rows):
        for offset in range(9):
            above, left, kernel = y + offset // 3, offset % 3, weight[offset]
            for c in range(0, padded.shape[2], 8):
                w0, w1, w2, w3 = kernel[c], kernel[c + 1], kernel[c + 2], kernel[c + 3]
                w4, w5, w6, w7 = kernel[c + 4], kernel[c + 5], kernel[c + 6], kernel[c + 7]
                for x in range(columns):
                    near, total = padded[above, x + left], sums[y, x]
                    v0, v1, v2, v3 = near[c], near[c + 1], near[c + 2], near[c + 3]
                    v4, v5, v6, v7 = near[c + 4], near[c + 5], near[c + 6], near[c + 7]
                    for k in range(outputs):
                        total[k] = (
                            total[k]
                            + v0 * w0[k]
                            + v1 * w1[k]
                            + v2 * w2[k]
                            + v3 * w3[k]
                            + v4 * w4[k]
                            + v5 * w5[k]
                            + v6 * w6[k]
                            + v7 * w7[k]
                        )


def _exact_products(layer: np.ndarray, weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """What `convolved` returns, as matrix products of neighbourhoods in blocks of rows."""
    rows, columns, channels = layer.shape
    kernel_step, step = _step_of(weight), _step_of(layer)
    kernel = _multiples(weight.reshape(-1, weight.shape[2]).astype(float), kernel_step)
    padded = np.pad(_multiples(layer.astype(np.float32), step), ((1, 1), (1, 1), (0, 0)))
    found = np.empty((rows, columns, weight.shape[2]), np.float32)
    height = max(1, _BLOCK_BYTES // (72 * channels * columns))
    for top in range(0, rows, height):
        count = min(height, rows - top)
        near = np.empty((count, columns, 9, channels))
        for offset in range(9):
            i, j = divmod(offset, 3)
            near[:, :, offset] = padded[top + i : top + i + count, j : j + columns]
        sums = near.reshape(count * columns, -1) @ kernel
        sums *= step * kernel_step
        found[top : top + count] = (sums + bias).reshape(count, columns, -1)
    return found


def _multiples(values: np.ndarray, step: float) -> np.ndarray:
    """Values, overwritten, as integer multiples of a step, a power of two."""
    values /= values.dtype.type(step)
    return np.rint(values, out=values)


def _step_of(values: np.ndarray) -> float:
    """A power of two such that the values are at most 2^20 multiples of it."""
    largest = max(float(values.max()), -float(values.min()))
    return float(2.0 ** (np.ceil(np.log2(largest)) - _BITS)) if largest > 0 else 1.0
