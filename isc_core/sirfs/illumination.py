"""Light as second-order spherical harmonics of the normal in log shading, and its Gaussian prior.

Equation: log shading_c = sum_k b_k(N) L_kc with N = (down, right, toward the viewer) and the nine
functions b of the SIRFS reference. A logarithm may have any sign, so nothing is clamped.

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712; the constants are those of R.
Ramamoorthi, P. Hanrahan 2001, doi:10.1145/383259.383317.

Limits: distant light, no cast shadows.
"""

import numpy as np

from .priors.priors import LightPrior


def light_cost(light: np.ndarray, prior: LightPrior, weight: float) -> tuple[float, np.ndarray]:
    """Compute the light's term, weight / (9 C) * 0.5 (l - mean)' covariance^-1 (l - mean).

    Parameters
    ----------
    light : (9, C) ndarray
        Coefficients; l is `stack(light)`.
    prior : LightPrior
    weight : float

    Returns
    -------
    cost : float
    gradient : (9, C) ndarray
    """
    difference = stack(light) - prior.mean
    gradient = np.einsum("ij,j->i", prior.precision, difference)
    scale = weight / difference.size
    return 0.5 * scale * float(difference @ gradient), unstack(scale * gradient, light.shape[1])


def stack(light: np.ndarray) -> np.ndarray:
    """Flatten a light, one channel after the other.

    Parameters
    ----------
    light : (9, C) ndarray
        SH coefficients.

    Returns
    -------
    (9 C,) ndarray
    """
    return np.ascontiguousarray(light.T).ravel()


def unstack(stacked: np.ndarray, channels: int) -> np.ndarray:
    """Invert `stack`.

    Parameters
    ----------
    stacked : (9 C,) ndarray
    channels : int
        C.

    Returns
    -------
    (9, C) ndarray
        SH coefficients.
    """
    return stacked.reshape(channels, 9).T
