"""The specular lobe around the mirror direction (Phong 1975).

Problem: a highlight that is brightest where the light is mirrored and fades with the angle from
there.

Equation: c is the cosine between the mirrored view and the light, clamped at 0. Plain, as
published: the RADIANCE is strength c^n per irradiance across the beam, without the cosine of the
light; so f_r = strength c^n / cos_light. Normalised (Lafortune & Willems 1994): f_r = strength (n +
2) / (2 pi) c^n, which reflects exactly `strength` of the light seen along the normal and less
elsewhere.

Citation: B. T. Phong, "Illumination for computer generated pictures", Communications of the ACM
18(6), 311-317 (1975), doi:10.1145/360825.360839. E. P. Lafortune and Y. D. Willems, "Using the
modified Phong reflectance model for physically based rendering", report CW 197, KU Leuven (1994),
which has no DOI.

Limits: plain Phong is NOT reciprocal and does not conserve energy; normalised Phong is reciprocal.
Neither grows toward grazing angles as real gloss does.
"""

from dataclasses import dataclass

import numpy as np

from .directions import Cosines, cosines
from .model import Parameter, check_range, log_above_zero, power


@dataclass(frozen=True, eq=False)
class PhongGradient:
    """Derivatives of f_r by the parameters, each (...).

    Attributes
    ----------
    strength, exponent : ndarray
    """

    strength: np.ndarray
    exponent: np.ndarray


@dataclass(frozen=True)
class Phong:
    """The Phong model.

    Attributes
    ----------
    strength : float or ndarray
        Factor of the lobe, >= 0; normalised, the share of the light that it reflects.
    exponent : float or ndarray
        >= 0, larger is glossier.
    normalised : bool
        See the module.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    strength: Parameter = 1.0
    exponent: Parameter = 20.0
    normalised: bool = True

    def __post_init__(self) -> None:
        check_range("strength", self.strength, 0, np.inf)
        check_range("exponent", self.exponent, 0, np.inf)

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
        return self.strength * self.gradient(normal, view, light).strength

    def gradient(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> PhongGradient:
        """Return the derivatives of `value` by strength and exponent.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors in one frame: surface normal, and directions to the camera and to the
            light.

        Returns
        -------
        PhongGradient
            Each derivative (...); 0 below the horizon.
        """
        angles = cosines(normal, view, light)
        mirrored = _mirrored(angles)
        lobe = np.where(angles.lit, power(mirrored, self.exponent), 0)
        if not self.normalised:
            lobe = lobe / angles.light
            return PhongGradient(lobe, self.strength * lobe * log_above_zero(mirrored))
        scale = (np.asarray(self.exponent) + 2) / (2 * np.pi)
        by_exponent = lobe * (1 / (2 * np.pi) + scale * log_above_zero(mirrored))
        return PhongGradient(scale * lobe, self.strength * by_exponent)


def _mirrored(angles: Cosines) -> np.ndarray:
    """Cosine between the mirrored view and the light, clamped to [0, 1], where lit."""
    return np.clip(2 * angles.view * angles.light - angles.between, 0, 1)
