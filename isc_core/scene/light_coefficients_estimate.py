"""A probabilistic estimate of a photo's light: a Gaussian over its spherical harmonics."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class LightCoefficientsEstimate:
    """Predicted light of a photo.

    Attributes
    ----------
    mean : (9, 3) ndarray
        Log-shading SH coefficients, ISC's convention (`shading.spherical_harmonics`).
    covariance : (27, 27) ndarray
        Of the coefficients one channel after the other, positive definite. The brightness shared
        by all channels is taken as unknown, whatever its covariance here.
    """

    mean: np.ndarray
    covariance: np.ndarray

    def brighter(self, log_factor: np.ndarray) -> "LightCoefficientsEstimate":
        """Multiply the shading of each channel by a constant.

        Parameters
        ----------
        log_factor : (3,) ndarray
            Natural logarithm of the factors.

        Returns
        -------
        LightCoefficientsEstimate
        """
        mean = self.mean.copy()
        mean[0] += np.sqrt(4 * np.pi) * log_factor
        return replace(self, mean=mean)
