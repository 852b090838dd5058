"""Superquadrics: spheres, ellipsoids, rounded boxes, cylinders, cushions, and everything in
between.

Equation: F(p) = (|x/a|^(2/e) + |z/c|^(2/e))^(e/n) + |y/b|^(2/n) = 1. F is homogeneous of degree
2/n, so that the surface lies at d F(d)^(-n/2) in the direction d; its normal is along the gradient
of F.

Citation: A. H. Barr, "Superquadrics and angle-preserving transformations", IEEE Computer Graphics
and Applications 1(1) (1981), doi:10.1109/MCG.1981.1673799.

Limits: exponents from 0.12 (edges still a few cells wide) to 1.2 (above that the surface has
creases).
"""

from dataclasses import dataclass

import numpy as np

from ..scene.meshes import Mesh
from .posing import posed
from .sphere_grid import sphere_grid
from .texture_coordinates import from_directions


@dataclass(frozen=True)
class Superquadric:
    """A superquadric.

    Attributes
    ----------
    axes : (float, float, float)
        Half axes (a, b, c) along x, y, z, > 0.
    around, upright : float
        Exponents e and n in [0.12, 1.2], as seen from above and from the side; 1 is round, toward 0
        square.
    """

    axes: tuple[float, float, float]
    around: float
    upright: float

    def mesh(self) -> Mesh:
        """Return the surface, y up."""
        directions, faces = sphere_grid()
        e, n = self.around, self.upright
        part = np.abs(directions / self.axes)
        level = part[:, 0] ** (2 / e) + part[:, 2] ** (2 / e)
        radius = (level ** (e / n) + part[:, 1] ** (2 / n)) ** (-n / 2)
        # The gradient of F, without the factor 2 / n; `level` is 0 on the y axis only, where x and
        # z are 0 as well.
        flat = np.where(level > 0, level, 1) ** (e / n - 1)
        slope = np.stack(
            [
                part[:, 0] ** (2 / e - 1) * flat,
                part[:, 1] ** (2 / n - 1),
                part[:, 2] ** (2 / e - 1) * flat,
            ],
            -1,
        )
        normals = np.sign(directions) * slope / self.axes
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return Mesh(directions * radius[:, None], normals, from_directions(directions), faces)


def superquadric(rng: np.random.Generator) -> Mesh:
    """Make a random superquadric, posed.

    Kinds are sphere, ellipsoid, box, cylinder, cushion or anything between.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Mesh
        Centred; the larger extent in the picture is 2 object units.
    """
    kind = rng.choice(
        ["sphere", "ellipsoid", "box", "cylinder", "cushion", "any"],
        p=[0.1, 0.15, 0.25, 0.15, 0.15, 0.2],
    )
    if kind == "sphere":
        return posed(Superquadric((1, 1, 1), 1, 1).mesh(), rng, (0, 20), 20)
    if kind == "ellipsoid":
        return posed(
            Superquadric((1, *rng.uniform(0.55, 0.95, 2)), 1, 1).mesh(), rng, (0, 30), 40, 40
        )
    if kind == "box":
        body = Superquadric((1, *rng.uniform(0.5, 1, 2)), *rng.uniform(0.12, 0.3, 2))
        return posed(
            body.mesh().rotated(_yaw(rng.choice([-1, 1]) * rng.uniform(25, 45))), rng, (18, 38), 3
        )
    if kind == "cylinder":
        body = Superquadric((1, rng.uniform(0.4, 1.6), 1), 1, rng.uniform(0.12, 0.35))
        return posed(body.mesh(), rng, (15, 38), 20, 12)
    if kind == "cushion":
        body = Superquadric(
            (1, rng.uniform(0.6, 1), rng.uniform(0.25, 0.5)),
            rng.uniform(0.7, 1.1),
            rng.uniform(0.3, 0.6),
        )
        return posed(body.mesh(), rng, (5, 30), 30, 12)
    body = Superquadric(
        (1, *rng.uniform(0.5, 1.2, 2)), *np.exp(rng.uniform(np.log(0.2), np.log(1.2), 2))
    )
    return posed(body.mesh(), rng, (8, 35), 40, 20)


def _yaw(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
