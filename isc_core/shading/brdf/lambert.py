"""The perfectly matt surface (Lambert 1760).

Problem: a surface that looks equally bright from everywhere.

Equation: f_r = albedo / pi. All the light is kept at albedo 1: the integral of f_r cos over the
hemisphere is the albedo.

Citation: J. H. Lambert, "Photometria", Augsburg (1760), which has no DOI.

Limits: real matt surfaces brighten toward grazing angles when rough (`oren_nayar`) and darken there
under a smooth coat.
"""

from dataclasses import dataclass

import numpy as np

from .directions import cosines
from .model import Parameter, check_range


@dataclass(frozen=True)
class LambertGradient:
    """`albedo` (...): the derivative of f_r by the albedo, in 1/sr."""

    albedo: np.ndarray


@dataclass(frozen=True)
class Lambert:
    """`albedo`: share of the light that is reflected, in [0, 1].

    Raises `InputError` outside it. Reciprocal.
    """

    albedo: Parameter = 1.0

    def __post_init__(self) -> None:
        check_range("albedo", self.albedo, 0, 1)

    def value(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        """f_r (...) in 1/sr for unit vectors (..., 3); 0 below the horizon."""
        return self.albedo * self.gradient(normal, view, light).albedo

    def gradient(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> LambertGradient:
        """The derivative of `value` by the albedo."""
        return LambertGradient(np.where(cosines(normal, view, light).lit, 1 / np.pi, 0))
