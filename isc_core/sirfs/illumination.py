"""Light as second-order spherical harmonics of the normal in log shading, and its Gaussian prior.

log shading_c = sum_k b_k(N) L_kc with N = (down, right, toward the viewer) and the nine functions b
of the SIRFS reference (Barron & Malik 2015, doi:10.1109/TPAMI.2014.2377712; the constants are those
of Ramamoorthi & Hanrahan 2001, doi:10.1145/383259.383317). No clamp: a logarithm may take any sign.
"""

import numpy as np

from .priors.priors import Light


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
