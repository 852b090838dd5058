"""The prior of the light, conditioned on the expected mean colour of the light.

Problem: a camera's white balance divides by the colour of the light, so a photo shows nearly white
light. A prior of lights alone does not include this: on an object of one strong colour, part of the
object's colour is attributed to the light.

Equation: the mean log shading of a ball, seen from the camera, is m_c = f' l_c, with f the means of
the nine functions over the projected disc (E N3 = 2/3, E N3^2 = 1/2, E N1^2 = E N2^2 = 1/4).
Brightness aside, m has two coordinates, along (1, -1, 0) and (1, 1, -2), H l. They are observed as
H log(colour) with a variance v, and the prior N(m0, S0) becomes
    K = S0 H' (H S0 H' + v)^-1,    mean = m0 + K (H log(colour) - H m0),    S = S0 - K H S0.

Citation: R. E. Kalman 1960, doi:10.1115/1.3662552 (the update of a Gaussian). Residual errors of
white balance: A. Gijsenij, T. Gevers, J. van de Weijer 2011, doi:10.1109/TIP.2011.2118224.

Limits: does not constrain the brightness, or how the colour varies with direction.
"""

import numpy as np

from ...numerics.linear import solve_linear
from ...shading.irradiance_basis import C2, C3, C4, C5
from .priors import LightPrior

_BALL_MEAN = np.array([C4, 0, 2 * C2 * 2 / 3, 0, 0, 0, C3 / 2 - C5, 0, 0])
_CHROMATICITY = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])


def with_light_colour(prior: LightPrior, colour: np.ndarray, variance: float) -> LightPrior:
    """Condition a prior on the mean colour of the light.

    Parameters
    ----------
    prior : LightPrior
        For three channels.
    colour : (3,) ndarray
        Linear RGB, > 0; its brightness is ignored.
    variance : float
        Of each of the two coordinates of the mean log shading's colour, > 0.

    Returns
    -------
    LightPrior
        Its mean is the initial light of `Start(light=1)`.
    """
    observation = np.kron(_CHROMATICITY, _BALL_MEAN)
    cross_covariance = np.einsum("ij,kj->ik", prior.covariance, observation)
    innovation_covariance = np.einsum(
        "ij,jk->ik", observation, cross_covariance
    ) + variance * np.eye(2)
    gain = solve_linear(innovation_covariance, cross_covariance.T).T
    innovation = np.einsum("ij,j->i", _CHROMATICITY, np.log(colour)) - np.einsum(
        "ij,j->i", observation, prior.mean
    )
    mean = prior.mean + np.einsum("ij,j->i", gain, innovation)
    remaining = prior.covariance - np.einsum("ij,kj->ik", gain, cross_covariance)
    return LightPrior(mean, (remaining + remaining.T) / 2, prior.unwhiten, mean)


def colour_on_a_ball(light: np.ndarray) -> np.ndarray:
    """Compute the mean colour of a white ball under a light.

    Parameters
    ----------
    light : (9, 3) ndarray
        Log-shading coefficients, reference convention.

    Returns
    -------
    (3,) ndarray
        Linear RGB of geometric mean 1.
    """
    log_colour = np.einsum("k,kc->c", _BALL_MEAN, light)
    return np.asarray(np.exp(log_colour - log_colour.mean()))
