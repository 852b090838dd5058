"""Compiled operations on many vectors, with the formulas of `pyramid` and `NumpyAlgebra`."""

# mypy: disable-error-code="no-untyped-def"
# (the compiler infers the types of every call)

from functools import partial

import numpy as np

from ..numerics.jit import ACCUMULATED, jit
from ..numerics.thread_pool import ThreadPool
from .pyramid import TAPS

_CHUNK = 1024
_PARTS = 8


@jit(types="i8 i8 r[2] r[2] f8[2]", math=ACCUMULATED)
def _products(first, last, vectors, others, sums):
    count = others.shape[0]
    zero = vectors.dtype.type(0)
    for start in range(first, last, _CHUNK):
        stop = min(start + _CHUNK, last)
        for k in range(vectors.shape[0]):
            v = vectors[k, start:stop]
            for m in range(count):
                w = others[m, start:stop]
                part = zero
                for j in range(stop - start):
                    part += v[j] * w[j]
                sums[k, m] += part


@jit(types="i8 i8 r[1] r[2] r[1]", math=ACCUMULATED)
def _combine(first, last, coefficients, vectors, out):
    for start in range(first, last, _CHUNK):
        stop = min(start + _CHUNK, last)
        o = out[start:stop]
        o[:] = vectors.dtype.type(0)
        for k in range(vectors.shape[0]):
            c = coefficients[k]
            if c == 0:
                continue
            v = vectors[k, start:stop]
            for j in range(stop - start):
                o[j] += c * v[j]


class CompiledAlgebra:
    """`lbfgs.Algebra` on compiled kernels.

    Sums are taken over a fixed number of parts, regardless of the number of threads.

    Parameters
    ----------
    workers : ThreadPool
    """

    def __init__(self, workers: ThreadPool) -> None:
        self._workers = workers

    def products(self, vectors: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return all inner products, see `Algebra`.

        Parameters
        ----------
        vectors : (K, N) ndarray
        others : (M, N) ndarray

        Returns
        -------
        (K, M) float64 ndarray
        """
        others = np.ascontiguousarray(others)
        sums = np.zeros((_PARTS, len(vectors), len(others)))
        self._workers.run(
            [
                partial(_products, a, b, vectors, others, sums[k])
                for k, (a, b) in enumerate(_parts(vectors.shape[1]))
            ]
        )
        return sums.sum(axis=0)

    def combine(self, coefficients: np.ndarray, vectors: np.ndarray, out: np.ndarray) -> None:
        """Write sum_k coefficients[k] vectors[k] into `out`, see `Algebra`.

        Parameters
        ----------
        coefficients : (K,) ndarray
        vectors : (K, N) ndarray
        out : (N,) ndarray
            Overwritten.
        """
        c = coefficients.astype(out.dtype)
        self._workers.run([partial(_combine, a, b, c, vectors, out) for a, b in _parts(out.size)])


def _parts(length: int) -> list[tuple[int, int]]:
    edges = [length * k // _PARTS for k in range(_PARTS + 1)]
    return list(zip(edges[:-1], edges[1:], strict=True))


@jit(types="r[2] r[2]", math=ACCUMULATED)
def down(fine, out):
    """Downsample by one level, see `pyramid.down`.

    Parameters
    ----------
    fine : (H, W) ndarray
    out : (ceil(H / 2), ceil(W / 2)) ndarray
    """
    t = fine.dtype.type
    a, b = t(TAPS[0]), t(TAPS[1])
    height, width = fine.shape
    rows, columns = out.shape
    line = np.empty(2 * columns + 3, fine.dtype)
    for i in range(rows):
        r0, r1 = fine[max(2 * i - 1, 0)], fine[2 * i]
        r2, r3 = fine[min(2 * i + 1, height - 1)], fine[min(2 * i + 2, height - 1)]
        middle = line[1 : width + 1]
        for j in range(width):
            middle[j] = a * (r0[j] + r3[j]) + b * (r1[j] + r2[j])
        line[0] = line[1]
        for j in range(width + 1, 2 * columns + 3):
            line[j] = line[width]
        o = out[i]
        for j in range(columns):
            o[j] = a * (line[2 * j] + line[2 * j + 3]) + b * (line[2 * j + 1] + line[2 * j + 2])


@jit(types="f8[2] r[2] f8[2]", math=ACCUMULATED)
def up_add(coarse, fine, out):
    """Write `fine` plus the adjoint of `down` applied to `coarse`, see `pyramid.up`.

    Parameters
    ----------
    coarse : (ceil(H / 2), ceil(W / 2)) ndarray
    fine : (H, W) ndarray
    out : (H, W) ndarray
    """
    t = coarse.dtype.type
    a, b = t(TAPS[0]), t(TAPS[1])
    height, width = fine.shape
    rows, columns = coarse.shape
    wide = np.empty(
        (2 * rows + 2, 2 * columns + 2), coarse.dtype
    )  # the adjoint before its borders are folded back
    line = np.empty(columns, coarse.dtype)
    for i in range(2 * rows + 2):
        # padded row i takes from coarse row k by tap i - 2k in 0..3
        k = i // 2
        near = b if i % 2 == 1 else a
        far = a if i % 2 == 1 else b
        for j in range(columns):
            line[j] = t(0)
        if k < rows:
            c = coarse[k]
            for j in range(columns):
                line[j] += near * c[j]
        if k >= 1:
            c = coarse[k - 1]
            for j in range(columns):
                line[j] += far * c[j]
        w = wide[i]
        w[0], w[1] = a * line[0], b * line[0]
        for j in range(1, columns):
            w[2 * j] = a * line[j] + b * line[j - 1]
            w[2 * j + 1] = b * line[j] + a * line[j - 1]
        w[2 * columns], w[2 * columns + 1] = b * line[columns - 1], a * line[columns - 1]
        w[1] += w[0]
        for j in range(width + 1, 2 * columns + 2):
            w[width] += w[j]
    for j in range(2 * columns + 2):
        wide[1, j] += wide[0, j]
        for i in range(height + 1, 2 * rows + 2):
            wide[height, j] += wide[i, j]
    for i in range(height):
        o, f, w = out[i], fine[i], wide[i + 1, 1 : width + 1]
        for j in range(width):
            o[j] = f[j] + w[j]
