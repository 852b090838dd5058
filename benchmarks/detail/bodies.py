"""Smooth bodies, and the coordinates by which relief and paint are laid on them.

Equation: coordinates (u, v), in pixels, are either those of the picture (a decal seen from the
front), turned by an angle, or go around a cylinder whose axis lies in the picture's plane,

    u = a,   v = R atan2(b, z - z0)

a and b along and across the axis (right and down for an angle of 0), R the radius of the body's
front. A displacement h(u, v) along the normal n turns the normal to

    n' ~ n - (g - n (n . g)),   g = h_u grad u + h_v grad v

which is exact but for the product of h and the curvature, some thousandths here.

Citation: J. F. Blinn (1978), "Simulation of wrinkled surfaces", doi:10.1145/965139.507101.

Limits: relief does not move the surface: there are no cast shadows, no parallax and no outline of
relief. Normals that would turn away from the viewer end at a cosine of `LEAST_COSINE`.
"""

from dataclasses import dataclass

import numpy as np

from synth.scene.meshes import Mesh
from synth.shapes import make_shape

SHAPES = ("superquadric", "blobby", "displaced", "lathe", "extruded")
LEAST_COSINE = 0.05
_FLAT = ("extruded",)  # families on which relief and paint are laid from the front
_LEAST_RADIUS = 0.3  # of a coordinate cylinder, half sides of the picture


@dataclass(frozen=True)
class Wrap:
    """Coordinates on a body.

    Attributes
    ----------
    angle : float
        Of the first axis in the picture, radians counter-clockwise from the right.
    axis_depth : float
        z of the cylinder's axis; infinite for coordinates of the picture.
    radius : float
        Of the cylinder.
    pixel : float
        Length of one pixel of the coordinates.
    """

    angle: float
    axis_depth: float
    radius: float
    pixel: float

    def at(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates and their gradients.

        Parameters
        ----------
        position : (N, 3) ndarray
            Camera frame.

        Returns
        -------
        uv : (N, 2) ndarray
            Pixels.
        gradient : (N, 2, 3) ndarray
            Dimensionless: pixels of the coordinates a pixel of length.
        """
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        along, across = np.array([cosine, sine, 0]), np.array([sine, -cosine, 0])
        a, b, depth = position @ along, position @ across, position[:, 2] - self.axis_depth
        first = np.broadcast_to(along, position.shape)
        if not np.isfinite(self.axis_depth):
            second = np.broadcast_to(across, position.shape)
            return np.stack([a, b], 1) / self.pixel, np.stack([first, second], 1)
        square = np.maximum(b**2 + depth**2, _LEAST_RADIUS**2)
        second = depth[:, None] * across - b[:, None] * np.array([0.0, 0, 1])
        second = second * (self.radius / square)[:, None]
        uv = np.stack([a, self.radius * np.arctan2(b, depth)], 1) / self.pixel
        return uv, np.stack([first, second], 1)


def smooth_body(family: str, rng: np.random.Generator, length: float) -> Mesh:
    """Make a body. Its normals, interpolated between vertices, are smooth at the photo's size.

    Parameters
    ----------
    family : str
        One of `SHAPES`.
    rng : numpy.random.Generator
    length : float
        Longer side in the picture, half sides of the picture.

    Returns
    -------
    Mesh
        Centred.
    """
    made = make_shape(family, rng).fitted()
    return Mesh(made.vertices * (length / 2), made.normals, made.uv, made.faces)


def draw_wrap(family: str, position: np.ndarray, rng: np.random.Generator, pixel: float) -> Wrap:
    """Draw coordinates for a body: around a cylinder, or from the front for flat bodies.

    Parameters
    ----------
    family : str
    position : (N, 3) ndarray
        Of the visible surface.
    rng : numpy.random.Generator
    pixel : float
        Length of one pixel.

    Returns
    -------
    Wrap
    """
    angle = rng.normal(0, 0.3) if rng.random() < 0.7 else rng.uniform(0, 2 * np.pi)
    around = rng.random() < 0.6
    if family in _FLAT or not around:
        return Wrap(angle, -np.inf, 1.0, pixel)
    front = float(np.quantile(position[:, 2], 0.95))
    middle = float(min(np.quantile(position[:, 2], 0.02), front - 2 * _LEAST_RADIUS))
    return Wrap(angle, middle, front - middle, pixel)


def displaced_normals(normal: np.ndarray, gradient: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Return the normals of a displaced surface.

    Parameters
    ----------
    normal : (N, 3) ndarray
        Unit, of the smooth surface.
    gradient : (N, 2, 3) ndarray
        Of the coordinates, see `Wrap.at`.
    slope : (N, 2) ndarray
        Derivatives of the displacement by the coordinates.

    Returns
    -------
    (N, 3) ndarray
        Unit.
    """
    steep = (slope[:, :, None] * gradient).sum(1)
    along = steep - normal * (steep * normal).sum(1, keepdims=True)
    return facing(normal - along)


def facing(normal: np.ndarray) -> np.ndarray:
    """Normalise, and turn to the viewer what looks away.

    Parameters
    ----------
    normal : (N, 3) ndarray

    Returns
    -------
    (N, 3) ndarray
        Unit, z at least `LEAST_COSINE`.
    """
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    z = np.maximum(unit[:, 2], LEAST_COSINE)
    across = np.linalg.norm(unit[:, :2], axis=1)
    scale = np.sqrt(1 - z**2) / np.maximum(across, 1e-9)
    return np.column_stack([unit[:, :2] * scale[:, None], z])
