"""A probabilistic estimate of an object's log shading: mean and deviation per pixel."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ShadingEstimate:
    """Predicted log shading of an object.

    The brightness that shading and albedo share is unknown: one constant per image, the same in all
    channels, may be added to `log_shading` without changing what it says.

    Attributes
    ----------
    log_shading : (H, W, 3) ndarray
        Mean of the natural logarithm of the shading, linear Rec.709; 0 outside the object.
    deviation : (H, W) ndarray
        Standard deviation of each channel, without that constant, > 0; 0 outside the object.
    """

    log_shading: np.ndarray
    deviation: np.ndarray
