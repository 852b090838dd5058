"""The prior of the light, conditioned on a prediction from the photo.

Problem: SIRFS finds the light together with the shape, and often a wrong pair of both. Shadows and
highlights, which show the light, are not in its model; a network reads them, and its prediction can
enter the prior.

Equation: a light is summarised by eight numbers q, the parts of its log shading along eight
orthonormal functions of the normals that face the viewer; with a constant, these span the harmonics
of degree 2. With q = A l for the light's coefficients l (the channels' mean), and q predicted with
deviations d,

    K = S A' (A S A' + diag d^2)^-1,    mean' = mean + K (q - A mean),    S' = S - K A S.

Citation: R. E. Kalman 1960, doi:10.1115/1.3662552 (the update of a Gaussian).

Limits: brightness and colour of the light are not predicted; both keep their prior.
"""

import numpy as np

from ...numerics.linear import solve_linear
from ...shading.spherical_harmonics import light_from_reference, real_sh
from .priors import LightPrior

_RINGS, _TURNS, _GRAZING = 12, 32, 0.1


def _front_normals() -> np.ndarray:
    """Normals (384, 3), evenly over those that face the viewer, symmetric in left and right."""
    z, turn = np.meshgrid(
        _GRAZING + (1 - _GRAZING) * (np.arange(_RINGS) + 0.5) / _RINGS,
        2 * np.pi * (np.arange(_TURNS) + 0.5) / _TURNS,
    )
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1).reshape(-1, 3)


def _light_terms() -> np.ndarray:
    """A (8, 9) for one channel, of the coefficients of `spherical_harmonics.real_sh`."""
    values = real_sh(FRONT_NORMALS)
    triangle = np.linalg.qr((values - values.mean(axis=0))[:, 1:] / np.sqrt(len(values)))[1]
    return np.hstack([np.zeros((8, 1)), triangle * np.sign(np.diag(triangle))[:, None]])


FRONT_NORMALS = _front_normals()
LIGHT_TERMS = _light_terms()


def predicted_light_prior(
    prior: LightPrior, predicted: np.ndarray, deviations: np.ndarray
) -> LightPrior:
    """Condition a prior on a prediction.

    Parameters
    ----------
    prior : LightPrior
        For C channels.
    predicted : (8,) ndarray
        Predicted light terms q, see `LIGHT_TERMS`.
    deviations : (8,) ndarray
        Their standard deviations, > 0.

    Returns
    -------
    LightPrior
    """
    channels = len(prior.mean) // 9
    terms = np.hstack([LIGHT_TERMS @ light_from_reference(np.eye(9)) / channels] * channels)
    across = np.einsum("ij,kj->ik", prior.covariance, terms)
    spread = np.einsum("ij,jk->ik", terms, across) + np.diag(np.square(deviations))
    gain = solve_linear(spread, across.T).T
    residual = predicted - np.einsum("ij,j->i", terms, prior.mean)
    mean = prior.mean + np.einsum("ij,j->i", gain, residual)
    covariance = prior.covariance - np.einsum("ij,kj->ik", gain, across)
    return LightPrior(mean, (covariance + covariance.T) / 2, prior.unwhiten, mean)
