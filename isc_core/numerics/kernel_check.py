# mypy: disable-error-code="no-untyped-def"
"""Whether a library of kernels computes what Python does, before anything depends on it.

A library may have been made for a system that nobody ran it on, or for another layout of NumPy's
arrays. One small kernel reads and writes arrays of several types, with and without gaps, takes
numbers of each type, more than fit into registers, and returns one. Its arithmetic is exact, so
that all must be equal to the last bit.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from .jit import jit
from .kernel_library import KernelLibrary


def passes(library: KernelLibrary) -> bool:
    """Run the kernel in a library and in Python.

    Parameters
    ----------
    library : KernelLibrary

    Returns
    -------
    bool
        Whether the results are equal.
    """
    kernel: Any = mix
    compiled = library.kernel(kernel.function, kernel.signatures)
    return outcome(compiled) == outcome(kernel.function)


def outcome(run: Callable[..., float]) -> tuple[float, bytes, bytes]:
    """Call the kernel.

    Parameters
    ----------
    run : callable
        `mix`, in any form.

    Returns
    -------
    tuple
        All that it computed.
    """
    values = np.arange(12, dtype=np.float32).reshape(3, 4) / 8
    order = np.array([2, 9, 0, 9, 1])[::2]
    sums = np.zeros(3)
    result = run(values, order, sums, 0.75, 1, 4, 2, 3, True, 5)
    return result, values.tobytes(), sums.tobytes()


@jit(types="f4[2] i8[1:] f8[1] f4 i8 i8 i8 i8 b1 i8 -> f8")
def mix(values, order, sums, factor, first, end, step, column, negate, weight):
    """Write sums of rows, between two columns, into both arrays.

    Parameters
    ----------
    values : (H, W) float32 ndarray
        Gets them in a column.
    order : (n,) int64 ndarray
        Which rows.
    sums : (n,) float64 ndarray
    factor : float
    first, end, step, column : int
    negate : bool
        Whether the column gets -sums.
    weight : int

    Returns
    -------
    float
        The sum of all, times the weight.
    """
    total = 0.0
    for i in range(len(order)):
        for k in range(first, end, step):
            sums[i] += factor * values[order[i], k]
        values[order[i], column] = -sums[i] if negate else sums[i]
        total += weight * sums[i]
    return total
