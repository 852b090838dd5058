"""One SIRFS problem: the image's logarithm, its valid pixels, the contour, and the priors."""

from dataclasses import dataclass

import numpy as np

from ..scene.known_inputs import DepthObservation
from ..shading.occluding_contour import Contour
from .priors.priors import Priors
from .settings import Weights
from .shading_term import ExpectedShading
from .silhouette import ExpectedNormals, SilhouetteNormals

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


@dataclass(frozen=True, eq=False)
class Problem:
    """A SIRFS problem.

    Attributes
    ----------
    log_image : (H, W, C) ndarray
        Natural logarithm of linear intensities, 0 where not `valid`.
    valid : (H, W) bool ndarray
        Pixels whose values are used.
    mask : (H, W) bool ndarray
        The object.
    contour : Contour
        Its occluding contour.
    priors : Priors
    weights : Weights
    observation : DepthObservation or None
        Observed depth.
    shading_only : bool
        Shape-from-shading mode: the reflectance is one unknown colour.
    silhouette : SilhouetteNormals or None
        Normals expected from the silhouette.
    pixel_weight : (H, W) ndarray or None
        Weight of a valid pixel in the reflectance terms, in [0, 1] and not 0 everywhere; a pair
        counts with the product. None: 1.
    predicted_normals : ExpectedNormals or None
    predicted_shading : ExpectedShading or None
    """

    log_image: np.ndarray
    valid: np.ndarray
    mask: np.ndarray
    contour: Contour
    priors: Priors
    weights: Weights
    observation: DepthObservation | None = None
    shading_only: bool = False
    silhouette: SilhouetteNormals | None = None
    pixel_weight: np.ndarray | None = None
    predicted_normals: ExpectedNormals | None = None
    predicted_shading: ExpectedShading | None = None

    @property
    def reflectance_weight(self) -> np.ndarray:
        """`pixel_weight` (H, W) float64, 0 where not valid."""
        return np.where(self.valid, 1.0 if self.pixel_weight is None else self.pixel_weight, 0.0)


@dataclass(frozen=True)
class Terms:
    """Weighted terms of the objective at one point, one attribute per term."""

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
    predicted_normals: float = 0.0
    predicted_shading: float = 0.0

    @property
    def total(self) -> float:
        """Value of the objective."""
        return sum(self.__dict__.values())


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Terms of the objective, and the gradients of their sum.

    Attributes
    ----------
    terms : Terms
    height_gradient : (H, W) ndarray
    light_gradient : (9, C) ndarray
    """

    terms: Terms
    height_gradient: np.ndarray
    light_gradient: np.ndarray
