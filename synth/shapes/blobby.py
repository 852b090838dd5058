"""Blobby objects: a few soft ellipsoids that merge, such as pebbles, knuckles, toy animals, jacks.

Equation: sum_i exp(B (1 - q_i(p))) = 1 with q_i(p) = |A_i (p - c_i)|^2, the squared distance from
the i-th centre in units of its radius. Each ellipsoid contains the origin (q_i(0) < 1). Along a ray
from the origin every term is above 1 until the ray leaves its ellipsoid and decreases from there,
so that the sum is 1 exactly once: the surface is star-shaped. Newton's method on the logarithm
solves for it.

Citation: J. F. Blinn, "A generalization of algebraic surface drawing", ACM Transactions on Graphics
1(3) (1982), doi:10.1145/357306.357310.

Limits: no holes, and no limb that hides another from the origin.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..scene.meshes import Mesh
from .posing import posed
from .sphere_grid import sphere_grid
from .texture_coordinates import from_directions

_STEPS = 8


@dataclass(frozen=True, eq=False)
class Blobs:
    """A sum of ellipsoidal blobs.

    Attributes
    ----------
    centres : (n, 3) ndarray
        Centres c_i.
    shapes : (n, 3, 3) ndarray
        A_i, which map the i-th ellipsoid, centred at the origin, to the unit ball; |A_i c_i| < 1.
    blobbiness : float
        B > 0; the larger, the less the blobs merge.
    """

    centres: np.ndarray
    shapes: np.ndarray
    blobbiness: float

    def mesh(self) -> Mesh:
        """Return the surface, y up."""
        directions, faces = sphere_grid()
        along = np.einsum("nij,vj->vni", self.shapes, directions)
        centre = np.einsum("nij,nj->ni", self.shapes, self.centres)
        # q_i(r d) = a r^2 - 2 b r + c
        a, b, c = (along**2).sum(-1), (along * centre).sum(-1), (centre**2).sum(-1)
        radius = ((b + np.sqrt(b**2 + a * (1 - c))) / a).max(1)
        for _ in range(_STEPS):
            level = 1 - (a * radius[:, None] ** 2 - 2 * b * radius[:, None] + c)
            share, total = self._shares(level)
            radius -= total / (share * 2 * (b - a * radius[:, None])).sum(1)
        share, _ = self._shares(1 - (a * radius[:, None] ** 2 - 2 * b * radius[:, None] + c))
        away = along * radius[:, None, None] - centre
        normals = np.einsum("vn,nij,vni->vj", share, self.shapes, away, optimize=True)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return Mesh(directions * radius[:, None], normals, from_directions(directions), faces)

    def _shares(self, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Share of each blob in the sum (V, n), and the logarithm of the sum divided by B (V,)."""
        top = level.max(1, keepdims=True)
        terms = np.exp(self.blobbiness * (level - top))
        total = terms.sum(1, keepdims=True)
        return terms / total, (top + np.log(total) / self.blobbiness)[:, 0]


def blobby(rng: np.random.Generator) -> Mesh:
    """Make a random blobby object: two to seven blobs, round or elongated, posed.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Mesh
        Centred; the larger extent in the picture is 2 object units.
    """
    count = int(rng.integers(2, 8))
    towards = rng.normal(size=(4 * count, 3)) * (1, 1, 0.7)
    towards = _spread(towards / np.linalg.norm(towards, axis=1, keepdims=True), count)
    length = rng.uniform(0.45, 0.75, count)
    width = length * rng.uniform(0.5, 1.0, count)
    centres = towards * (length * rng.uniform(0.55, 0.9, count))[:, None]
    turns = [Rotation.align_vectors([toward], [(0, 0, 1)])[0].as_matrix() for toward in towards]
    shapes = np.stack(
        [
            np.diag([1 / w, 1 / w, 1 / l]) @ turn.T
            for turn, w, l in zip(turns, width, length, strict=True)
        ]
    )
    return posed(
        Blobs(centres, shapes, np.exp(rng.uniform(np.log(1.2), np.log(5)))).mesh(),
        rng,
        (0, 25),
        30,
        15,
    )


def _spread(candidates: np.ndarray, count: int) -> np.ndarray:
    """Choose `count` of the unit vectors, each as far as possible from the previous ones."""
    chosen = [candidates[0]]
    while len(chosen) < count:
        nearest = np.max([candidates @ one for one in chosen], axis=0)
        chosen.append(candidates[nearest.argmin()])
    return np.stack(chosen)
