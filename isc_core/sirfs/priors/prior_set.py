"""The fitted priors in compact form: a few numbers each, from which the solver's tables follow.

Everything of Barron & Malik (2015), doi:10.1109/TPAMI.2014.2377712, for colour and grey photos in
natural and laboratory light.
"""

from dataclasses import dataclass, field

import numpy as np

from ...errors import InputError
from .absolute_table import CoarseTable
from .color_mixture import ColorScaleMixture
from .lights import Contrast, GaussianLight
from .priors import Priors, SilhouetteProfile
from .scale_mixture import ScaleMixture

ILLUMINATIONS = ("natural", "laboratory")


@dataclass(frozen=True)
class Lights:
    """A light prior for each kind of photo, in colour (27 coefficients); those for grey photos
    follow.
    """

    natural: GaussianLight
    laboratory: GaussianLight


@dataclass(frozen=True)
class FitRecord:
    """Where a set comes from: the training objects' names, the factors on the environments'
    contrast, the options as text.
    """

    objects: tuple[str, ...] = ()
    natural_contrast: Contrast = field(default_factory=Contrast)
    options: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class PriorSet:
    """All priors, compact.

    `parsimony_whiten` is (3, 3); the grey tables live in plain log reflectance.
    """

    curvature: ScaleMixture
    grey_smoothness: ScaleMixture
    color_smoothness: ColorScaleMixture
    parsimony_whiten: np.ndarray
    absolute: CoarseTable
    grey_absolute: CoarseTable
    silhouette: SilhouetteProfile
    lights: Lights
    record: FitRecord

    def priors(self, illumination: str = "natural", channels: int = 3) -> Priors:
        """The solver's tables.

        `illumination`: "natural" or "laboratory"; `channels`: 3 or 1. Raises `InputError` for
        others.
        """
        if illumination not in ILLUMINATIONS:
            raise InputError(
                f"unknown illumination '{illumination}': use one of {', '.join(ILLUMINATIONS)}"
            )
        if channels not in (1, 3):
            raise InputError(f"priors are for 1 or 3 channels, not {channels}")
        light = self.lights.natural if illumination == "natural" else self.lights.laboratory
        if channels == 1:
            return Priors(
                channels=1,
                curvature=self.curvature.table(),
                smoothness=self.grey_smoothness.table(),
                smoothness_whiten=np.eye(1),
                parsimony_whiten=np.eye(1),
                absolute=self.grey_absolute.table(),
                light=light.grey().light(),
                silhouette=self.silhouette,
            )
        return Priors(
            channels=3,
            curvature=self.curvature.table(),
            smoothness=self.color_smoothness.table(),
            smoothness_whiten=self.color_smoothness.whiten(),
            parsimony_whiten=self.parsimony_whiten,
            absolute=self.absolute.table(),
            light=light.light(),
            silhouette=self.silhouette,
        )
