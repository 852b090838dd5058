# mypy: disable-error-code="no-untyped-def"
"""Projection of image patches on the Walsh-Hadamard basis.

Problem: comparing two patches of 8 x 8 pixels costs 64 products per channel. In natural images a
few coefficients of an orthonormal basis have most of a patch's energy, and any subset of them gives
a lower bound of the distance: with r_a the norm of the rest of a, sum over the subset of (a_k -
b_k)^2 + (r_a - r_b)^2 <= |a - b|^2.

Equation: P = H X H^T / 8 for a channel's patch X, H the Hadamard matrix (entries +1 and -1): only
additions, by the fast transform. Neighbouring patches of a row share the sums of their columns.
Colour channels are mixed beforehand by an orthonormal matrix with rows grey, red-green and
yellow-blue, so that brightness, which carries most of the energy, is one channel.

Citation: Y. Hel-Or and H. Hel-Or, "Real-time pattern matching using projection kernels", IEEE TPAMI
27(9), 1430-1445 (2005), doi:10.1109/TPAMI.2005.184. The kept coefficients are those with the most
energy in the image itself, not a fixed order.

Limits: patches are 8 x 8 pixels.
"""

from functools import partial

import numpy as np

from ..numerics.jit import jit
from ..numerics.thread_pool import ThreadPool

PATCH = 8
_CELLS = PATCH * PATCH
_OPPONENT = np.array([[1, 1, 1], [1, -1, 0], [1, 1, -2]]) / np.sqrt([[3], [2], [6]])
# The energies of coefficients are measured on this many patches.
_SAMPLE = 4096
_RUN = 64  # columns transformed at a time


def opponent(image: np.ndarray) -> np.ndarray:
    """Convert three channels to grey, red-green and yellow-blue; distances are preserved.

    Parameters
    ----------
    image : (H, W, C) ndarray

    Returns
    -------
    (H, W, C) float32 ndarray
        Contiguous.
    """
    if image.shape[2] != 3:
        return np.ascontiguousarray(image, np.float32)
    # one product of tall matrices: NumPy multiplies a stack of them one by one
    return (image.reshape(-1, 3) @ _OPPONENT.T).astype(np.float32).reshape(image.shape)


def strongest(image: np.ndarray, rows: np.ndarray, columns: np.ndarray, count: int) -> np.ndarray:
    """Return the coefficients with the largest variance over patches, the strongest first.

    Parameters
    ----------
    image : (H, W, C) float32 ndarray
    rows, columns : (n,) ndarray
        Upper left corners.
    count : int

    Returns
    -------
    (count,) ndarray
        Indices below 64 C.
    """
    step = max(1, len(rows) // _SAMPLE)
    all_coefficients = np.arange(_CELLS * image.shape[2])
    variance = project(image, rows[::step], columns[::step], all_coefficients)[:, :-1].var(axis=0)
    return np.argsort(-variance, kind="stable")[:count]


def project(
    image: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
    chosen: np.ndarray,
    workers: ThreadPool | None = None,
) -> np.ndarray:
    """Project patches.

    The squared distance of two rows never exceeds that of their patches. Fastest for patches in
    raster order.

    Parameters
    ----------
    image : (H, W, C) float32 ndarray
    rows, columns : (n,) ndarray
        Upper left corners.
    chosen : (k,) ndarray
        Coefficients.
    workers : ThreadPool, optional
        By default, one thread.

    Returns
    -------
    (n, k + 1) float32 ndarray
        The last column is the norm of the rest.
    """
    out = np.empty((len(rows), len(chosen) + 1), np.float32)
    workers = workers or ThreadPool(1)
    ends = np.linspace(0, len(rows), 4 * workers.threads + 1).astype(int)
    workers.run(
        [
            partial(_project, image, rows[a:b], columns[a:b], chosen, out[a:b])
            for a, b in zip(ends[:-1], ends[1:], strict=True)
        ]
    )
    return out


@jit(types="f4[3] i8[1:] i8[1:] i8[1] f4[2]")
def _project(image, rows, columns, chosen, out):
    channels = image.shape[2]
    strip, below = np.empty((8, _RUN + 7), np.float32), np.empty((8, _RUN + 7), np.float32)
    full, rest = np.empty((64 * channels, _RUN), np.float32), np.empty(_RUN, np.float32)
    first = 0
    while first < rows.shape[0]:
        last = _end_of_run(rows, columns, first)
        row, left = rows[first], columns[first]
        count = columns[last] - left + 1
        for c in range(channels):
            for i in range(8):
                for x in range(count + 7):
                    strip[i, x] = image[row + i, left + x, c]
            _butterflies(strip, count + 7)
            for i in range(8):
                _across(strip, i, below, full, 64 * c + i, count)
        rest[:count] = 0
        for k in range(full.shape[0]):
            for x in range(count):
                rest[x] += full[k, x] * full[k, x]
        for k in range(chosen.shape[0]):
            for x in range(count):
                rest[x] -= full[chosen[k], x] * full[chosen[k], x]
        for n in range(first, last + 1):
            x = columns[n] - left
            for k in range(chosen.shape[0]):
                out[n, k] = full[chosen[k], x] * np.float32(0.125)
            out[n, -1] = np.sqrt(max(rest[x], np.float32(0))) * np.float32(0.125)
        first = last + 1


@jit
def _end_of_run(rows, columns, first):
    """The last patch that shares its row, and the transforms of its columns, with patch `first`."""
    last, end = first, columns[first] + _RUN
    while (
        last + 1 < rows.shape[0]
        and rows[last + 1] == rows[first]
        and columns[last] < columns[last + 1] < min(columns[last] + 8, end)
    ):
        last += 1
    return last


@jit
def _butterflies(work, count):
    """The Hadamard transform of the first `count` columns of `work` (8, n), in place."""
    for step in (1, 2, 4):
        for i in range(8):
            if i & step == 0:
                for j in range(count):
                    a, b = work[i, j], work[i + step, j]
                    work[i, j] = a + b
                    work[i + step, j] = a - b


@jit
def _across(strip, i, work, full, at, count):
    """The transforms of strip[i, x : x + 8], x < `count`, to rows `at`, `at` + 8 ... of `full`."""
    for x in range(count + 6):
        work[0, x] = strip[i, x] + strip[i, x + 1]
        work[1, x] = strip[i, x] - strip[i, x + 1]
    for j in range(2):
        for x in range(count + 4):
            work[2 + j, x] = work[j, x] + work[j, x + 2]
            work[4 + j, x] = work[j, x] - work[j, x + 2]
    for j in range(4):
        for x in range(count):
            full[at + 8 * j, x] = work[2 + j, x] + work[2 + j, x + 4]
            full[at + 8 * j + 32, x] = work[2 + j, x] - work[2 + j, x + 4]
