# mypy: disable-error-code="no-untyped-def"
"""Checks that a library of kernels gives the results of Python before it is used.

A library may have been built for a system on which it was never tested, or for another layout of
NumPy's arrays. One small kernel reads and writes arrays of several types, contiguous and strided,
takes scalars of each type, more than fit into registers, and returns a scalar. Its arithmetic is
exact, so that all results must agree to the last bit.
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
        All results.
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
        The sums are written into one of its columns.
    order : (n,) int64 ndarray
        Indices of the rows.
    sums : (n,) float64 ndarray
    factor : float
    first, end, step, column : int
    negate : bool
        Whether -sums are written into the column.
    weight : int

    Returns
    -------
    float
        The total of the sums, times the weight.
    """
    total = 0.0
    for i in range(len(order)):
        for k in range(first, end, step):
            sums[i] += factor * values[order[i], k]
        values[order[i], column] = -sums[i] if negate else sums[i]
        total += weight * sums[i]
    return total
