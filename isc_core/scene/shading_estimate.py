"""A probabilistic estimate of an object's log shading: mean and deviation per pixel."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class ShadingEstimate:
    """Predicted log shading of an object.

    The brightness that shading and albedo share is unknown: one constant per image, the same in all
    channels, may be added to `log_shading` without a change of meaning.

    Attributes
    ----------
    log_shading : (H, W, 3) ndarray
        Mean of the natural logarithm of the shading, linear Rec.709; 0 outside the object.
    deviation : (H, W) ndarray
        Standard deviation of each channel, without that constant, > 0; 0 outside the object.
    """

    log_shading: np.ndarray
    deviation: np.ndarray

    def brighter(self, log_factor: np.ndarray) -> "ShadingEstimate":
        """Multiply the shading of each channel by a constant.

        Parameters
        ----------
        log_factor : (3,) ndarray
            Natural logarithm of the factors.

        Returns
        -------
        ShadingEstimate
        """
        known = self.deviation[..., None] > 0
        return replace(self, log_shading=np.where(known, self.log_shading + log_factor, 0))
