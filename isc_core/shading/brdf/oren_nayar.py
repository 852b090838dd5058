"""The rough diffuse surface, qualitative model (Oren & Nayar 1994).

Problem: clay, cloth or the moon look flatter than a Lambertian sphere and reflect back toward the
light.

Equation: with facets whose slopes have the standard deviation s (radians), a the larger and b the
smaller of the angles of view and light, and d the azimuth between them, f_r = albedo / pi (A + B
max(0, cos d) sin a tan b), A = 1 - .5 s^2 / (s^2 + .33), B = .45 s^2 / (s^2 + .09). cos d sin a tan
b = (view . light - cos a cos b) / max(cos a, cos b), which needs no azimuth and is defined at the
pole.

Citation: M. Oren and S. K. Nayar, "Generalization of Lambert's reflectance model", SIGGRAPH 1994,
239-246, doi:10.1145/192161.192213.

Limits: a short form of the authors' full model, without light between facets: a white rough surface
loses light (22 % at s = .5 seen from above), and below s = .3 a grazing view gains up to 1.5 % too
much. s = 0 is Lambert. Reciprocal. Where both angles are grazing f_r grows without bound, but f_r
cos stays finite.
"""

from dataclasses import dataclass

import numpy as np

from .directions import Cosines, cosines
from .model import Parameter, check_range


@dataclass(frozen=True, eq=False)
class OrenNayarGradient:
    """Derivatives of f_r by the parameters, each (...).

    Attributes
    ----------
    albedo, sigma : ndarray
    """

    albedo: np.ndarray
    sigma: np.ndarray


@dataclass(frozen=True)
class OrenNayar:
    """The Oren-Nayar model.

    Attributes
    ----------
    albedo : float or ndarray
        Of the facets, in [0, 1].
    sigma : float or ndarray
        Standard deviation of their slope angles in radians, in [0, pi/2].

    Raises
    ------
    InputError
        Outside these ranges.
    """

    albedo: Parameter = 1.0
    sigma: Parameter = 0.3

    def __post_init__(self) -> None:
        check_range("albedo", self.albedo, 0, 1)
        check_range("sigma", self.sigma, 0, np.pi / 2)

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

    def gradient(
        self, normal: np.ndarray, view: np.ndarray, light: np.ndarray
    ) -> OrenNayarGradient:
        """Return the derivatives of `value` by albedo and sigma.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors in one frame: surface normal, and directions to the camera and to the
            light.

        Returns
        -------
        OrenNayarGradient
            Each derivative (...); 0 below the horizon.
        """
        angles = cosines(normal, view, light)
        term = _azimuth_term(angles)
        square = np.square(self.sigma)
        flat = 1 - 0.5 * square / (square + 0.33) + 0.45 * square / (square + 0.09) * term
        by_sigma = self.sigma * (-0.33 / (square + 0.33) ** 2 + 0.081 / (square + 0.09) ** 2 * term)
        return OrenNayarGradient(
            np.where(angles.lit, flat / np.pi, 0),
            np.where(angles.lit, self.albedo * by_sigma / np.pi, 0),
        )


def _azimuth_term(angles: Cosines) -> np.ndarray:
    """max(0, cos d) sin a tan b (...), >= 0."""
    return np.maximum(angles.between - angles.view * angles.light, 0) / np.maximum(
        angles.view, angles.light
    )
