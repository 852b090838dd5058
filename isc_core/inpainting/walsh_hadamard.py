# mypy: disable-error-code="no-untyped-def"
"""Projection of image patches on the Walsh-Hadamard basis.

Problem: comparing two patches of 8 x 8 pixels costs 64 products per channel. In natural images a
few coefficients of an orthonormal basis have most of a patch's energy, and any subset of them gives
a lower bound of the distance: with r_a the norm of the rest of a, sum over the subset of (a_k -
b_k)^2 + (r_a - r_b)^2 <= |a - b|^2.

Equation: P = H X H^T / 8 for a channel's patch X, H the Hadamard matrix (entries +1 and -1): only
additions, 24 for each row and column by the fast transform. Colour channels are mixed beforehand by
an orthonormal matrix with rows grey, red-green, yellow-blue, so that brightness, which carries most
of the energy, is one channel.

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
    rotated = image @ _OPPONENT.T if image.shape[2] == 3 else image
    return np.ascontiguousarray(rotated, np.float32)


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
    image: np.ndarray, rows: np.ndarray, columns: np.ndarray, chosen: np.ndarray, threads: int = 1
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
    threads : int

    Returns
    -------
    (n, k + 1) float32 ndarray
        The last column is the norm of the rest.
    """
    out = np.empty((len(rows), len(chosen) + 1), np.float32)
    ends = np.linspace(0, len(rows), 4 * threads + 1).astype(int)
    with ThreadPool(threads) as workers:
        workers.run(
            [
                partial(_project, image, rows[a:b], columns[a:b], chosen, out[a:b])
                for a, b in zip(ends[:-1], ends[1:], strict=True)
            ]
        )
    return out


@jit(types="f4[3] i8[1:] i8[1:] i8[1] f4[2]")
def _project(image, rows, columns, chosen, out):
    width, channels = image.shape[1], image.shape[2]
    strip = np.empty((8, width), np.float32)
    halfway = np.empty((channels, width, 8), np.float32)
    work = np.empty((8, 8), np.float32)
    full = np.empty(64 * channels, np.float32)
    row = -1
    for n in range(rows.shape[0]):
        if rows[n] != row:
            row = rows[n]
            # Patches of one row share their columns, which are transformed once.
            for c in range(channels):
                for i in range(8):
                    for x in range(width):
                        strip[i, x] = image[row + i, x, c]
                _butterflies(strip)
                for x in range(width):
                    for i in range(8):
                        halfway[c, x, i] = strip[i, x]
        for c in range(channels):
            for j in range(8):
                for i in range(8):
                    work[j, i] = halfway[c, columns[n] + j, i]
            _butterflies(work)
            for j in range(8):
                for i in range(8):
                    full[64 * c + 8 * j + i] = work[j, i]
        rest = np.float32(0)
        for k in range(full.shape[0]):
            rest += full[k] * full[k]
        for k in range(chosen.shape[0]):
            out[n, k] = full[chosen[k]] * np.float32(0.125)
            rest -= full[chosen[k]] * full[chosen[k]]
        out[n, -1] = np.sqrt(max(rest, np.float32(0))) * np.float32(0.125)


@jit
def _butterflies(work):
    """The Hadamard transform of each column of `work` (8, n), in place."""
    for step in (1, 2, 4):
        for i in range(8):
            if i & step == 0:
                for j in range(work.shape[1]):
                    a, b = work[i, j], work[i + step, j]
                    work[i, j] = a + b
                    work[i + step, j] = a - b
