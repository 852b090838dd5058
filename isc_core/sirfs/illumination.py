"""Light as second-order spherical harmonics of the normal in log shading, and its Gaussian prior.

log shading_c = sum_k b_k(N) L_kc with N = (down, right, toward the viewer) and the nine functions b
of the SIRFS reference (Barron & Malik 2015, doi:10.1109/TPAMI.2014.2377712; the constants are those
of Ramamoorthi & Hanrahan 2001, doi:10.1145/383259.383317). No clamp: a logarithm may take any sign.
"""

import numpy as np

from .priors import Light

C1, C2, C3, C4, C5 = 0.429043, 0.511664, 0.743125, 0.886227, 0.247708


def basis(n1: np.ndarray, n2: np.ndarray, n3: np.ndarray) -> np.ndarray:
    """The nine functions b of the normal's components (any one shape S): (9, *S)."""
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
    """Gradient of the normal's components from the gradient `d` (9, *S) of the nine functions."""
    t = n1.dtype.type
    d1 = t(2 * C2) * d[3] + t(2 * C1) * (n2 * d[4] + n3 * d[7] + n1 * d[8])
    d2 = t(2 * C2) * d[1] + t(2 * C1) * (n1 * d[4] + n3 * d[5] - n2 * d[8])
    d3 = t(2 * C2) * d[2] + t(2 * C1) * (n2 * d[5] + n1 * d[7]) + t(2 * C3) * n3 * d[6]
    return d1, d2, d3


def light_cost(light: np.ndarray, prior: Light, weight: float) -> tuple[float, np.ndarray]:
    """The light's term and its gradient.

    `light`: (9, C). The term is weight / (9 C) * 0.5 (l - mean)' covariance^-1 (l - mean), l the
    channels stacked.
    """
    away = stack(light) - prior.mean
    pull = np.einsum("ij,j->i", prior.precision, away)
    scale = weight / away.size
    return 0.5 * scale * float(away @ pull), unstack(scale * pull, light.shape[1])


def stack(light: np.ndarray) -> np.ndarray:
    """(9, C) to 9 C numbers, one channel after the other."""
    return np.ascontiguousarray(light.T).ravel()


def unstack(stacked: np.ndarray, channels: int) -> np.ndarray:
    """The inverse of `stack`."""
    return stacked.reshape(channels, 9).T
