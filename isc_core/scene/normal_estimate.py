"""A probabilistic estimate of an object's normal map: mean and deviation per pixel."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class NormalEstimate:
    """Predicted normal map of an object.

    Attributes
    ----------
    normal : (H, W, 3) ndarray
        Mean of the probable unit normals, so at most of length 1; camera frame: x right, y up, z
        toward the viewer; 0 outside the object.
    deviation : (H, W) ndarray
        Standard deviation of its x and of its y, > 0; 0 outside the object.
    """

    normal: np.ndarray
    deviation: np.ndarray
