"""One SIRFS problem: the photo's logarithm, where it is valid, the contour, and what is believed
beforehand.
"""

from dataclasses import dataclass

import numpy as np

from ..scene.known_inputs import DepthObservation
from ..shading.occluding_contour import Contour
from .priors.priors import Priors
from .settings import Weights
from .silhouette import ExpectedNormals

# Half of the offsets (down, right) in a 5 x 5 window: every unordered pair once.
PAIR_OFFSETS = (
    (0, 1),
    (0, 2),
    (1, -2),
    (1, -1),
    (1, 0),
    (1, 1),
    (1, 2),
    (2, -2),
    (2, -1),
    (2, 0),
    (2, 1),
    (2, 2),
)


@dataclass(frozen=True)
class Problem:
    """`log_image`: (H, W, C) natural logarithm of linear intensities, 0 where not `valid`; `valid`:
    (H, W) bool.

    `mask`: (H, W) bool, the object; `contour`: its occluding contour.

    `silhouette`: what the outline says of the normals. `shading_only`: shape-from-shading mode,
    reflectance is taken as one unknown colour. `pixel_weight`: (H, W) in [0, 1], how much a valid pixel
    counts in the terms of reflectance, of a pair the product; not 0 everywhere. None: 1.
    """

    log_image: np.ndarray
    valid: np.ndarray
    mask: np.ndarray
    contour: Contour
    priors: Priors
    weights: Weights
    observation: DepthObservation | None = None
    shading_only: bool = False
    silhouette: ExpectedNormals | None = None
    pixel_weight: np.ndarray | None = None

    @property
    def reflectance_weight(self) -> np.ndarray:
        """`pixel_weight` (H, W) float64, 0 where not valid."""
        return np.where(self.valid, 1.0 if self.pixel_weight is None else self.pixel_weight, 0.0)


@dataclass(frozen=True)
class Terms:
    """The weighted terms of the objective at one state."""

    curvature: float = 0.0
    contour: float = 0.0
    slant: float = 0.0
    smoothness: float = 0.0
    parsimony: float = 0.0
    absolute: float = 0.0
    light: float = 0.0
    silhouette: float = 0.0
    observation: float = 0.0
    shading_only: float = 0.0

    @property
    def total(self) -> float:
        """The objective's value."""
        return sum(self.__dict__.values())


@dataclass(frozen=True)
class Evaluation:
    """Terms with the gradients of their sum with respect to the height (H, W) and the light (9, C)."""

    terms: Terms
    height_gradient: np.ndarray
    light_gradient: np.ndarray
