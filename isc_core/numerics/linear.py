"""Small systems of equations, solved with the same bytes on any number of threads.

Problem: a library's solver shares its sums among its threads, and rounds otherwise on one than on
two; a solve with many minima makes another shape of the last digit. Equation: A X = B by Gauss and
Jordan's elimination with the largest pivot of each column, row by row.

Citation: G. H. Golub, C. F. Van Loan, "Matrix Computations" (2013), section 3.4. Limits: n^3 steps
of NumPy's; meant for tens of unknowns.
"""

import numpy as np


def solve_linear(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """X (n, m) of `matrix` (n, n) X = `right` (n, m), float64.

    Raises `ValueError` where `matrix` has no inverse.
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
