"""The fitted priors in compact form: a few numbers each, from which the solver's tables follow.

All priors of J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712, for colour and grey
photos in natural and laboratory light.
"""

from dataclasses import dataclass, field

import numpy as np

from ...errors import InputError
from .absolute_table import CoarseTable
from .color_mixture import ColorScaleMixture
from .lights import Contrast, GaussianLight
from .priors import Priors, SilhouetteProfile
from .scale_mixture import ScaleMixture

ILLUMINATIONS = ("natural", "laboratory", "photo")


@dataclass(frozen=True)
class LightPriors:
    """Light priors for each kind of photo.

    Attributes
    ----------
    natural, laboratory, photo : GaussianLight or None
        In colour (27 coefficients); those for grey photos follow. None where a set has none.
    """

    natural: GaussianLight | None = None
    laboratory: GaussianLight | None = None
    photo: GaussianLight | None = None

    def of(self, illumination: str) -> GaussianLight | None:
        """Return the prior of one kind of photo.

        Parameters
        ----------
        illumination : str
            One of `ILLUMINATIONS`; "photo" falls back to natural light if the set has no light of
            photos.

        Returns
        -------
        GaussianLight or None
        """
        found: GaussianLight | None = getattr(self, illumination)
        return self.natural if found is None and illumination == "photo" else found


@dataclass(frozen=True)
class FitRecord:
    """The origin of a set.

    Attributes
    ----------
    objects : tuple of str
        Names of the training objects.
    natural_contrast : Contrast
        Factors on the contrast of the lights of environments.
    options : dict of str
        Every option of the fit, as text.
    """

    objects: tuple[str, ...] = ()
    natural_contrast: Contrast = field(default_factory=Contrast)
    options: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PriorSet:
    """All priors, compact.

    Attributes
    ----------
    curvature, grey_smoothness : ScaleMixture
    color_smoothness : ColorScaleMixture
    parsimony_whiten : (3, 3) ndarray
        Whitening of log reflectance; grey tables are over log reflectance itself.
    absolute, grey_absolute : CoarseTable
    silhouette : SilhouetteProfile
    lights : LightPriors
    record : FitRecord
    """

    curvature: ScaleMixture
    grey_smoothness: ScaleMixture
    color_smoothness: ColorScaleMixture
    parsimony_whiten: np.ndarray
    absolute: CoarseTable
    grey_absolute: CoarseTable
    silhouette: SilhouetteProfile
    lights: LightPriors
    record: FitRecord

    def priors(self, illumination: str = "natural", channels: int = 3) -> Priors:
        """Return the solver's tables.

        Parameters
        ----------
        illumination : str
            One of `ILLUMINATIONS`.
        channels : int
            3 or 1.

        Returns
        -------
        Priors

        Raises
        ------
        InputError
            For other values, and where the set has no lights of this kind.
        """
        if illumination not in ILLUMINATIONS:
            raise InputError(
                f"unknown illumination '{illumination}': use one of {', '.join(ILLUMINATIONS)}"
            )
        if channels not in (1, 3):
            raise InputError(f"priors are for 1 or 3 channels, not {channels}")
        light = self.lights.of(illumination)
        if light is None:
            raise InputError(
                f"these priors have no light for --illumination {illumination}:"
                " use --illumination photo, or fit them to MIT-Berkeley with 'isc fit-priors'"
            )
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
