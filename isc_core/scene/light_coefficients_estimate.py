"""A probabilistic estimate of a photo's light: a Gaussian over its spherical harmonics."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LightCoefficientsEstimate:
    """Predicted light of a photo.

    Attributes
    ----------
    mean : (9, 3) ndarray
        Log-shading SH coefficients, ISC's convention (`shading.spherical_harmonics`).
    covariance : (27, 27) ndarray
        Of the coefficients one channel after the other, positive definite. The brightness shared
        by all channels is taken as unknown, whatever is said of it here.
    """

    mean: np.ndarray
    covariance: np.ndarray
