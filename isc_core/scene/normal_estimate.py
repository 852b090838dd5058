"""A probabilistic estimate of an object's normal map: mean and deviation per pixel."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class NormalEstimate:
    """`normal` (H, W, 3): the mean of the unit normals that are likely, so at most 1 long; x right,
    y up, z toward the viewer. `deviation` (H, W), > 0: of its x and y each. Both 0 outside the
    object.
    """

    normal: np.ndarray
    deviation: np.ndarray
