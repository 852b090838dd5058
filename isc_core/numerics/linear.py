"""Small systems of linear equations, solved with the same bytes on any number of threads.

Problem: a library's solver splits its sums among its threads, so it rounds differently on one than
on two; a solve with many minima turns that into another shape.

Equation: A X = B by Gauss-Jordan elimination with partial pivoting, row by row.

Citation: G. H. Golub, C. F. Van Loan, "Matrix Computations" (2013), section 3.4.

Limits: n^3 operations in NumPy; meant for tens of unknowns.
"""

import numpy as np


def solve_linear(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve `matrix` X = `right`.

    Parameters
    ----------
    matrix : (n, n) ndarray
    right : (n, m) ndarray

    Returns
    -------
    (n, m) float64 ndarray

    Raises
    ------
    ValueError
        If `matrix` is singular.
    """
    size = len(matrix)
    work = np.concatenate([matrix, right], axis=1, dtype=float)
    for k in range(size):
        pivot = k + int(np.abs(work[k:, k]).argmax())
        if work[pivot, k] == 0:
            raise ValueError("the matrix has no inverse")
        work[[k, pivot]] = work[[pivot, k]]
        work[k] /= work[k, k]
        factors = work[:, k].copy()
        factors[k] = 0
        work -= factors[:, None] * work[k]
    return work[:, size:]
