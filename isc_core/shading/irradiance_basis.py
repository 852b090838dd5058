"""The nine quadratic basis functions of the SIRFS reference, and their adjoint.

Equation: log shading_c = sum_k b_k(N) L_kc with N = (down, right, toward the viewer).

Citation: the basis of J. T. Barron and J. Malik, TPAMI 2015, doi:10.1109/TPAMI.2014.2377712; its
constants are those of R. Ramamoorthi and P. Hanrahan, SIGGRAPH 2001, doi:10.1145/383259.383317.

Limits: the constants are rounded to six digits, as published.
"""

import numpy as np

C1, C2, C3, C4, C5 = 0.429043, 0.511664, 0.743125, 0.886227, 0.247708


def basis(n1: np.ndarray, n2: np.ndarray, n3: np.ndarray) -> np.ndarray:
    """Evaluate the nine functions b.

    Parameters
    ----------
    n1, n2, n3 : ndarray
        Components of the unit normal (down, right, toward the viewer), of one shape S.

    Returns
    -------
    (9, *S) ndarray
    """
    t = n1.dtype.type
    return np.stack(
        [
            np.full_like(n1, C4),
            t(2 * C2) * n2,
            t(2 * C2) * n3,
            t(2 * C2) * n1,
            t(2 * C1) * n1 * n2,
            t(2 * C1) * n2 * n3,
            t(C3) * n3 * n3 - t(C5),
            t(2 * C1) * n1 * n3,
            t(C1) * (n1 * n1 - n2 * n2),
        ]
    )


def basis_adjoint(
    n1: np.ndarray, n2: np.ndarray, n3: np.ndarray, d: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute the gradient of the normal from that of the nine functions.

    Parameters
    ----------
    n1, n2, n3 : ndarray
        As for `basis`.
    d : (9, *S) ndarray
        Gradient with respect to the nine functions.

    Returns
    -------
    d1, d2, d3 : ndarray
        Gradient with respect to the normal's components.
    """
    t = n1.dtype.type
    d1 = t(2 * C2) * d[3] + t(2 * C1) * (n2 * d[4] + n3 * d[7] + n1 * d[8])
    d2 = t(2 * C2) * d[1] + t(2 * C1) * (n1 * d[4] + n3 * d[5] - n2 * d[8])
    d3 = t(2 * C2) * d[2] + t(2 * C1) * (n2 * d[5] + n1 * d[7]) + t(2 * C3) * n3 * d[6]
    return d1, d2, d3
