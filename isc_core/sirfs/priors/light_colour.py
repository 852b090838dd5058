"""The prior of the light, told which colour the light has on average.

Problem: a camera's white balance divides by the colour of the light, so a photo shows nearly white
light. A prior of lights alone does not know this: on an object of one strong colour it trades the
object's colour for the light's.

Equation: seen from the camera, a ball turns its normals toward the light so that the mean of its
log shading is m_c = f' l_c, with f the means of the nine functions over the projected disc
(E N3 = 2/3, E N3^2 = 1/2, E N1^2 = E N2^2 = 1/4). Brightness aside, two coordinates of m are left,
along (1, -1, 0) and (1, 1, -2), H l. They are expected at H log(colour) with a variance v, and the
prior N(m0, S0) becomes
    K = S0 H' (H S0 H' + v)^-1,    mean = m0 + K (H log(colour) - H m0),    S = S0 - K H S0.

Citation: R. E. Kalman 1960, doi:10.1115/1.3662552 (the update of a Gaussian). What white
balance leaves: A. Gijsenij, T. Gevers, J. van de Weijer 2011, doi:10.1109/TIP.2011.2118224.

Limits: says nothing of how the colour varies with direction, nor of a brightness.
"""

import numpy as np

from ...numerics.linear import solve_linear
from ...shading.irradiance_basis import C2, C3, C4, C5
from .priors import LightPrior

_BALL = np.array([C4, 0, 2 * C2 * 2 / 3, 0, 0, 0, C3 / 2 - C5, 0, 0])
_ACROSS = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])


def with_light_colour(prior: LightPrior, colour: np.ndarray, variance: float) -> LightPrior:
    """Expect a colour of the light.

    Parameters
    ----------
    prior : LightPrior
        For three channels.
    colour : (3,) ndarray
        Linear RGB, > 0; its brightness has no meaning.
    variance : float
        Of each of the two coordinates of the mean log shading's colour, > 0.

    Returns
    -------
    LightPrior
        Its mean is where a `Start` of light 1 starts.
    """
    seen = np.kron(_ACROSS, _BALL)
    across = np.einsum("ij,kj->ik", prior.covariance, seen)
    spread = np.einsum("ij,jk->ik", seen, across) + variance * np.eye(2)
    gain = solve_linear(spread, across.T).T
    away = np.einsum("ij,j->i", _ACROSS, np.log(colour)) - np.einsum("ij,j->i", seen, prior.mean)
    mean = prior.mean + np.einsum("ij,j->i", gain, away)
    left = prior.covariance - np.einsum("ij,kj->ik", gain, across)
    return LightPrior(mean, (left + left.T) / 2, prior.unwhiten, mean)


def colour_on_a_ball(light: np.ndarray) -> np.ndarray:
    """Compute the colour of a light, as a white ball shows it on average.

    Parameters
    ----------
    light : (9, 3) ndarray
        Log-shading coefficients, reference convention.

    Returns
    -------
    (3,) ndarray
        Linear RGB of geometric mean 1.
    """
    log_colour = np.einsum("k,kc->c", _BALL, light)
    return np.asarray(np.exp(log_colour - log_colour.mean()))
