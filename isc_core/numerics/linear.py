"""Small systems of linear equations, solved with the same bytes on any number of threads.

Problem: LAPACK splits its sums among its threads, so it rounds differently on one thread than on
two; with an objective of many minima, the difference leads to another shape.

Equation: A X = B by Gauss-Jordan elimination with partial pivoting, row by row. Least squares of
two unknowns >= 0: where the unconstrained solution has a negative one, one unknown is 0 in the
constrained solution.

Citation: G. H. Golub, C. F. Van Loan, "Matrix Computations" (2013), section 3.4; C. L. Lawson,
R. J. Hanson, "Solving Least Squares Problems" (1974), chapter 23.

Limits: n^3 operations in NumPy; meant for tens of unknowns. Normal equations lose half of the
digits where the two columns are nearly parallel; where they cannot be distinguished, one of them
gets the whole sum.
"""

import numpy as np

_PARALLEL = 1e-12  # squared sine of the angle between two columns


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


def nonnegative_pair(first: np.ndarray, second: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Find a, b >= 0 that minimise |a first + b second - values|^2.

    SciPy's `nnls` does it for any number of columns, but takes a quarter of a second to import.

    Parameters
    ----------
    first, second : (N,) ndarray
    values : (N,) ndarray

    Returns
    -------
    (2,) ndarray
    """
    columns = np.stack([first, second]).astype(float)
    gram = np.einsum("in,jn->ij", columns, columns)
    right = np.einsum("in,n->i", columns, values)
    determinant = gram[0, 0] * gram[1, 1] - gram[0, 1] ** 2
    # Of nearly parallel columns, the determinant is rounding, and one of them fits as well.
    if determinant > _PARALLEL * gram[0, 0] * gram[1, 1]:
        cofactors = np.array([[gram[1, 1], -gram[0, 1]], [-gram[0, 1], gram[0, 0]]])
        free = np.einsum("ij,j->i", cofactors, right) / determinant
        if (free >= 0).all():
            return free
    alone = np.maximum(right, 0) / np.maximum(np.diagonal(gram), np.finfo(float).tiny)
    return np.where(np.arange(2) == int(np.argmax(alone * right)), alone, 0)
