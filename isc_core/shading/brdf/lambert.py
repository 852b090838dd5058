"""The perfectly diffuse surface (Lambert 1760).

Problem: a surface that looks equally bright from everywhere.

Equation: f_r = albedo / pi. The integral of f_r cos over the hemisphere is the albedo; at 1 all the
light is reflected.

Citation: J. H. Lambert, "Photometria", Augsburg (1760), which has no DOI.

Limits: real diffuse surfaces brighten toward grazing angles when rough (`oren_nayar`) and darken
there under a smooth coat.
"""

from dataclasses import dataclass

import numpy as np

from .directions import cosines
from .model import Parameter, check_range


@dataclass(frozen=True, eq=False)
class LambertGradient:
    """Derivative of f_r by the parameter.

    Attributes
    ----------
    albedo : (...) ndarray
        In 1/sr.
    """

    albedo: np.ndarray


@dataclass(frozen=True)
class Lambert:
    """The Lambertian model; reciprocal.

    Attributes
    ----------
    albedo : float or ndarray
        Share of the light that is reflected, in [0, 1].

    Raises
    ------
    InputError
        Outside this range.
    """

    albedo: Parameter = 1.0

    def __post_init__(self) -> None:
        check_range("albedo", self.albedo, 0, 1)

    def value(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        """Return f_r.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors in one frame: surface normal, and directions to the camera and to the
            light.

        Returns
        -------
        (...) ndarray
            In 1/sr, 0 below the horizon.
        """
        return self.albedo * self.gradient(normal, view, light).albedo

    def gradient(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> LambertGradient:
        """Return the derivative of `value` by the albedo.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors in one frame: surface normal, and directions to the camera and to the
            light.

        Returns
        -------
        LambertGradient
            The derivative (...) in 1/sr; 0 below the horizon.
        """
        return LambertGradient(np.where(cosines(normal, view, light).lit, 1 / np.pi, 0))
