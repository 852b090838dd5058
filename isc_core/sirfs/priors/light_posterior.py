"""The prior of the light, multiplied by a predicted Gaussian.

Problem: a data set gives the distribution of natural lights, a network an estimate of this photo's
light; the solver needs one Gaussian over the light's coefficients.

Equation: the product of the prior N(m0, S0) and the prediction N(m1, t S1), which is the prior
weighted by the prediction's likelihood, is the Gaussian of the summed precisions; without inverses,
    K = S0 (S0 + t S1)^-1,    mean = m0 + K (m1 - m0),    S = S0 - K S0.
The temperature t, 1 for calibrated predictions, is above 1 for overconfident ones. A photo does not
determine a brightness common to all channels: S1 is given a large variance along it.

Citation: R. E. Kalman 1960, doi:10.1115/1.3662552 (the update of a Gaussian).

Limits: both are assumed to be Gaussian, and independent of each other.
"""

import numpy as np

from ...numerics.linear import solve_linear
from ...scene.light_coefficients_estimate import LightCoefficientsEstimate
from ...shading.irradiance_basis import C4
from ...shading.spherical_harmonics import light_to_reference
from .priors import LightPrior

_BRIGHTNESS = 10.0  # deviation of the log brightness: uninformative


def light_posterior(
    prior: LightPrior, estimate: LightCoefficientsEstimate, temperature: float = 1.0
) -> LightPrior:
    """Multiply a prior by a prediction.

    Parameters
    ----------
    prior : LightPrior
        For C channels.
    estimate : LightCoefficientsEstimate
        Prediction; a prior for grey uses the mean of its channels.
    temperature : float
        Factor of the prediction's covariance, > 0.

    Returns
    -------
    LightPrior
        Its mean is the initial light of `Start(light=1)`.
    """
    mean, covariance = _in_reference(estimate, len(prior.mean) // 9)
    bright = np.zeros((len(mean), 1))
    bright[::9] = _BRIGHTNESS / C4  # log shading 1 in the reference's first function
    innovation_covariance = prior.covariance + temperature * covariance + bright * bright.T
    gain = solve_linear(innovation_covariance, prior.covariance).T
    posterior_mean = prior.mean + np.einsum("ij,j->i", gain, mean - prior.mean)
    remaining = prior.covariance - np.einsum("ij,jk->ik", gain, prior.covariance)
    return LightPrior(posterior_mean, (remaining + remaining.T) / 2, prior.unwhiten, posterior_mean)


def _in_reference(
    estimate: LightCoefficientsEstimate, channels: int
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (9 C,) and covariance (9 C, 9 C) in the reference's convention."""
    change = np.kron(np.eye(3), light_to_reference(np.eye(9)))
    if channels == 1:
        change = change.reshape(3, 9, 27).mean(axis=0)
    mean = np.einsum("ij,j->i", change, estimate.mean.T.ravel().astype(float))
    across = np.einsum("ij,jk->ik", change, estimate.covariance.astype(float))
    return mean, np.einsum("ij,kj->ik", across, change)
