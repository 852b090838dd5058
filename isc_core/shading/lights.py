"""Lights for editing: one distant light with an ambient part, the recovered light rotated, an
environment.

Equation: for the unit normal n of a Lambertian surface of albedo 1: under a distant light with
irradiance E from l and an ambient A, S(n) = E / pi max(0, n . l) + A; under spherical harmonics
S(n) = exp(sum_k L_k Y_k(n)). A light turned by the rotation R gives S'(n) = S(R^T n); its
coefficients are L' = Y(d)^+ Y(R^T d) L for any directions d that determine a quadratic on the
sphere, because the space of the nine functions is closed under rotation: exact up to rounding.

Citation: R. Ramamoorthi, P. Hanrahan, "An efficient representation for irradiance environment
maps", SIGGRAPH 2001, doi:10.1145/383259.383317 (the space of nine functions).

Limits: no cast shadows. The recovered light from behind the object lit no visible normal: turned to
the front, it is a guess.
"""

from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError
from .brdf.directions import unit
from .brdf.model import check_range
from .spherical_harmonics import real_sh

VIEW = np.array([0.0, 0.0, 1.0])
"""Unit vector toward the viewer, camera frame."""

_EXACT = 1e-12


@dataclass(frozen=True, eq=False)
class DirectionalLight:
    """One distant light with an ambient part.

    Attributes
    ----------
    direction : (3,) ndarray
        Unit vector toward the light, camera frame.
    irradiance : (3,) ndarray
        On a plane across its beam, >= 0; pi gives a white Lambertian surface that faces it the
        shading 1.
    ambient : (3,) ndarray
        Shading added everywhere, >= 0.

    Raises
    ------
    InputError
        For other values.
    """

    direction: np.ndarray
    irradiance: np.ndarray = field(default_factory=lambda: np.full(3, np.pi))
    ambient: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        unit(self.direction, "direction")
        check_range("irradiance", self.irradiance, 0, np.inf)
        check_range("ambient", self.ambient, 0, np.inf)
        if (
            not np.shape(self.direction)
            == np.shape(self.irradiance)
            == np.shape(self.ambient)
            == (3,)
        ):
            raise InputError("direction, irradiance and ambient of a light have three numbers each")

    def shading(self, normal: np.ndarray) -> np.ndarray:
        """Compute the shading of a white Lambertian surface, attached shadow included.

        Parameters
        ----------
        normal : (..., 3) ndarray
            Unit normals, camera frame.

        Returns
        -------
        (..., 3) ndarray
        """
        return (
            np.maximum(np.asarray(normal, float) @ self.direction, 0)[..., None]
            * (self.irradiance / np.pi)
            + self.ambient
        )


def toward(x: float, y: float, z: float) -> np.ndarray:
    """Return the unit vector of a direction.

    Parameters
    ----------
    x, y, z : float
        Right, up, toward the viewer; any length.

    Returns
    -------
    (3,) ndarray

    Raises
    ------
    InputError
        If all are 0 or one is not finite.
    """
    vector = np.array([x, y, z], float)
    length = float(np.linalg.norm(vector))
    if not np.isfinite(length) or length < 1e-9:
        raise InputError(
            f"{x:g} {y:g} {z:g} is no direction:"
            " give x (right), y (up), z (toward the viewer), not all 0"
        )
    return vector / length


def turn(yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    """Return the rotation by `roll` about z, then `pitch` about x, then `yaw` about y.

    A positive yaw moves the front to the right, a positive pitch the top to the front, a positive
    roll the right side up.

    Parameters
    ----------
    yaw, pitch, roll : float
        Degrees.

    Returns
    -------
    (3, 3) ndarray

    Raises
    ------
    InputError
        If an angle is not finite.
    """
    if not np.isfinite([yaw, pitch, roll]).all():
        raise InputError("the angles of a rotation have to be finite, in degrees")
    about_y, about_x, about_z = (
        _plane_turn(angle, *axes)
        for angle, axes in ((yaw, (2, 0)), (pitch, (1, 2)), (roll, (0, 1)))
    )
    return about_y @ about_x @ about_z


def turned_light(coefficients: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Rotate a light: what came from d then comes from rotation @ d.

    Parameters
    ----------
    coefficients : (9, 3) ndarray
        Log-shading SH coefficients, camera frame.
    rotation : (3, 3) ndarray
        The identity returns exactly the same coefficients.

    Returns
    -------
    (9, 3) ndarray

    Raises
    ------
    InputError
        If `rotation` is not a rotation.
    """
    if (
        np.shape(rotation) != (3, 3)
        or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-9
        or np.linalg.det(rotation) < 0
    ):
        raise InputError(
            "this is not a rotation: give an orthonormal matrix (3, 3) of determinant 1"
        )
    if np.array_equal(rotation, np.eye(3)):
        return np.array(coefficients, float)
    directions = sphere_directions(64)
    return np.linalg.pinv(real_sh(directions)) @ real_sh(directions @ rotation) @ coefficients


def sphere_directions(count: int) -> np.ndarray:
    """Return unit vectors spread evenly over the sphere, along a spiral from front to back.

    Parameters
    ----------
    count : int

    Returns
    -------
    (count, 3) ndarray
    """
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], -1)


def _plane_turn(degrees: float, first: int, second: int) -> np.ndarray:
    """Rotation of the axis `first` toward the axis `second`."""
    matrix = np.eye(3)
    cosine, sine = _clean(np.cos(np.deg2rad(degrees))), _clean(np.sin(np.deg2rad(degrees)))
    matrix[first, first] = matrix[second, second] = cosine
    matrix[second, first], matrix[first, second] = sine, -sine
    return matrix


def _clean(value: float) -> float:
    """Make full and quarter turns exact."""
    return float(np.rint(value)) + 0.0 if abs(value - np.rint(value)) < _EXACT else float(value)
