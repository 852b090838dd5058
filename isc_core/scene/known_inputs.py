"""What is known of a scene besides its photo: exact shape, exact light, observed depth."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class KnownInputs:
    """Known quantities of a scene as a user supplies them, at the photo's full size.

    Attributes
    ----------
    height : (H, W) ndarray or None
        Exact shape, photo pixels toward the viewer.
    light : (9, 3) ndarray or None
        Exact log-shading SH coefficients, ISC's convention (`shading.spherical_harmonics`).
    depth : (H, W) ndarray or None
        Observed depth, photo pixels toward the viewer, with holes (NaN).
    depth_sigma : float
        Standard error of `depth`, photo pixels.
    depth_weight : float
        Weight of the depth term in the objective.
    """

    height: np.ndarray | None = None
    light: np.ndarray | None = None
    depth: np.ndarray | None = None
    depth_sigma: float = 2.0
    depth_weight: float = 10.0


@dataclass(frozen=True, eq=False)
class DepthObservation:
    """Heights from another source, such as a depth sensor: a map with holes.

    Attributes
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer, up to an additive constant; NaN where nothing was measured.
    sigma : float
        Standard error, pixels; larger differences cost linearly, so that outliers do not dominate.
    weight : float
        Weight of the whole term.
    """

    height: np.ndarray
    sigma: float = 2.0
    weight: float = 10.0


@dataclass(frozen=True, eq=False)
class SceneConstraints:
    """What SIRFS takes as given, each at the image's scale; read inside the mask only.

    Attributes
    ----------
    height : (H, W) ndarray or None
        Fixed shape, pixels toward the viewer.
    light : (9, C) ndarray or None
        Fixed log-shading SH coefficients, reference convention.
    depth : DepthObservation or None
        Observed depth.
    """

    height: np.ndarray | None = None
    light: np.ndarray | None = None
    depth: DepthObservation | None = None
