"""The specular lobe of the half vector (Blinn 1977).

Problem: highlights stretch at grazing angles, which the mirror direction alone does not give;
facets that face the half vector do.

Equation: h is the unit vector midway between view and light, c = max(0, normal . h), p the
exponent. Three scales: "plain", as published: the RADIANCE is strength c^p per irradiance across
the beam, so f_r = strength c^p / cos_light. "normalised", the usual factor: f_r = strength (p + 8)
/ (8 pi) c^p. "conserving": f_r = strength (p + 2) (p + 4) / (8 pi (p + 2^(-p/2))) c^p, which
reflects exactly `strength` of the light seen along the normal.

Citation: J. F. Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH
1977, 192-198, doi:10.1145/563858.563893.

Limits: seen along the normal the usual factor reflects strength (p + 8) (p + 2^(-p/2)) / ((p + 2)
(p + 4)): too MUCH, 1.075 at most (p = 9), 1.018 at p = 100, 1.001 at p = 2000. The conserving
factor never reflects more than `strength`. "plain" is NOT reciprocal, the others are. No scale
grows toward grazing angles as real gloss does.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ...errors import InputError
from .directions import cosines
from .model import Parameter, check_range, log_above_zero, power

Scale = Literal["plain", "normalised", "conserving"]


@dataclass(frozen=True, eq=False)
class BlinnPhongGradient:
    """Derivatives of f_r by the parameters, each (...).

    Attributes
    ----------
    strength, exponent : ndarray
    """

    strength: np.ndarray
    exponent: np.ndarray


@dataclass(frozen=True)
class BlinnPhong:
    """The Blinn-Phong model.

    Attributes
    ----------
    strength : float or ndarray
        Factor of the lobe, >= 0.
    exponent : float or ndarray
        p >= 0, larger is glossier.
    scale : str
        "plain", "normalised" or "conserving", see the module.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    strength: Parameter = 1.0
    exponent: Parameter = 50.0
    scale: Scale = "normalised"

    def __post_init__(self) -> None:
        check_range("strength", self.strength, 0, np.inf)
        check_range("exponent", self.exponent, 0, np.inf)
        if self.scale not in get_args(Scale):
            raise InputError(
                f"unknown scale {self.scale!r}: choose one of {', '.join(get_args(Scale))}"
            )

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

    def gradient(
        self, normal: np.ndarray, view: np.ndarray, light: np.ndarray
    ) -> BlinnPhongGradient:
        """Return the derivatives of `value` by strength and exponent.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors in one frame: surface normal, and directions to the camera and to the
            light.

        Returns
        -------
        BlinnPhongGradient
            Each derivative (...); 0 below the horizon.
        """
        angles = cosines(normal, view, light)
        lobe = np.where(angles.lit, power(angles.half, self.exponent), 0)
        if self.scale == "plain":
            lobe = lobe / angles.light
        factor, by_exponent = _factor(np.asarray(self.exponent, float), self.scale)
        change = lobe * (by_exponent + factor * log_above_zero(angles.half))
        return BlinnPhongGradient(factor * lobe, self.strength * change)


def _factor(exponent: np.ndarray, scale: Scale) -> tuple[np.ndarray, np.ndarray]:
    """The factor that a scale puts before c^p, and its derivative by p."""
    if scale == "plain":
        return np.ones_like(exponent), np.zeros_like(exponent)
    if scale == "normalised":
        return (exponent + 8) / (8 * np.pi), np.full_like(exponent, 1 / (8 * np.pi))
    tail = 2.0 ** (-exponent / 2)
    factor = (exponent + 2) * (exponent + 4) / (8 * np.pi * (exponent + tail))
    slope = 1 / (exponent + 2) + 1 / (exponent + 4) - (1 - np.log(2) / 2 * tail) / (exponent + tail)
    return factor, factor * slope
