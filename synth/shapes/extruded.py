"""Extruded outlines with rounded edges: stars, gears, flowers, hearts, letters, rounded polygons,
their front toward the viewer.

Equation: a closed polygon is smoothed along its length by a Gaussian (corners become round), and
swept from the centre of the front to its edge, around a quarter circle to the wall, and likewise to
the centre of the back. The front may be domed: z = -k |(x, y)|^2.

Limits: star-shaped outlines about the origin, no holes. The radius of the edge is limited by the
corners.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ..scene.meshes import Mesh, grid_faces
from .posing import posed

_COLUMNS, _CAP, _EDGE, _WALL = 600, 16, 12, 10
KINDS = ("star", "gear", "flower", "heart", "letter", "polygon")
_OFTEN = (0.2, 0.18, 0.18, 0.08, 0.2, 0.16)
_LETTERS = {
    "L": [(-0.35, 1), (-0.95, 1), (-0.95, -0.95), (0.8, -0.95), (0.8, -0.35), (-0.35, -0.35)],
    "T": [
        (0.3, 0.3),
        (0.95, 0.3),
        (0.95, 0.9),
        (-0.95, 0.9),
        (-0.95, 0.3),
        (-0.3, 0.3),
        (-0.3, -1.1),
        (0.3, -1.1),
    ],
    "X": [
        (0.38, 0),
        (1, 0.95),
        (0.4, 0.95),
        (0, 0.4),
        (-0.4, 0.95),
        (-1, 0.95),
        (-0.38, 0),
        (-1, -0.95),
        (-0.4, -0.95),
        (0, -0.4),
        (0.4, -0.95),
        (1, -0.95),
    ],
    "Y": [
        (0.3, -0.05),
        (0.95, 0.95),
        (0.35, 0.95),
        (0, 0.35),
        (-0.35, 0.95),
        (-0.95, 0.95),
        (-0.3, -0.05),
        (-0.3, -1),
        (0.3, -1),
    ],
    "+": [
        (0.34, 0.34),
        (0.34, 1),
        (-0.34, 1),
        (-0.34, 0.34),
        (-1, 0.34),
        (-1, -0.34),
        (-0.34, -0.34),
        (-0.34, -1),
        (0.34, -1),
        (0.34, -0.34),
        (1, -0.34),
        (1, 0.34),
    ],
    "arrow": [
        (1.1, 0),
        (0.2, 0.85),
        (0.2, 0.36),
        (-0.9, 0.36),
        (-0.9, -0.36),
        (0.2, -0.36),
        (0.2, -0.85),
    ],
}
_MIDDLE = {"L": (-0.65, -0.65), "T": (0, 0.6), "Y": (0, 0.05), "arrow": (0.25, 0)}


@dataclass(frozen=True, eq=False)
class Extrusion:
    """A prism with rounded corners and edges.

    Attributes
    ----------
    polygon : (n, 2) ndarray
        Corners, counter-clockwise, star-shaped about the origin.
    depth : float
        Distance of front and back.
    rounding : float
        Of the polygon's corners.
    edge : float
        Maximum radius of the edge between front and wall.
    dome : float
        Curvature k of the front; the dome is less than half the depth high.
    """

    polygon: np.ndarray
    depth: float
    rounding: float
    edge: float
    dome: float = 0.0

    def mesh(self) -> Mesh:
        """Return the surface, its front toward +z.

        The texture is projected from the front, and continues over the edge along the wall.
        """
        outline, normal, tightest = smooth_outline(self.polygon, self.rounding)
        lowest = self.depth / 2 - self.dome * float((outline**2).sum(1).max())  # of the front's rim
        edge = min(self.edge, 0.8 * tightest, 0.9 * lowest)
        # The rounding begins at the slope with which the domed front ends, to avoid a crease.
        begin = np.arctan(2 * self.dome * np.maximum((outline * normal).sum(1), 0))[:, None]
        rim = outline - edge * (1 - np.sin(begin)) * normal
        scale = np.linspace(0, 1, _CAP)[:, None, None]
        cap = _lifted(rim * scale, self.depth / 2 - self.dome * ((rim * scale) ** 2).sum(-1))
        lean = begin + (np.pi / 2 - begin) * np.linspace(0, 1, _EDGE + 1)[1:, None, None]
        fall = edge * (np.cos(lean) - np.cos(begin))[..., 0]
        bend = _lifted(rim + edge * (np.sin(lean) - np.sin(begin)) * normal, cap[-1, :, 2] + fall)
        front = np.concatenate([cap, bend])
        out = np.concatenate([normal, np.zeros((len(normal), 1))], -1)
        cap_normals = np.concatenate(
            [2 * self.dome * cap[..., :2], np.ones((*cap.shape[:2], 1))], -1
        )
        normals = np.concatenate([cap_normals, _bend_normals(bend, out, lean)])
        down = np.linspace(0, 1, _WALL + 2)[1:-1, None, None]
        wall = front[-1] * (1 - down) + front[-1] * (1, 1, -1) * down
        points = np.concatenate([front, wall, front[::-1] * (1, 1, -1)])
        normals = np.concatenate(
            [normals, np.broadcast_to(out, wall.shape), normals[::-1] * (1, 1, -1)]
        )
        return _mesh(points, normals, normal)


def extruded(rng: np.random.Generator) -> Mesh:
    """Make a random extrusion, posed.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Mesh
        Centred; the larger extent in the picture is 2 object units.
    """
    kind = str(rng.choice(KINDS, p=_OFTEN))
    polygon = random_polygon(kind, rng)
    depth = rng.uniform(0.35, 0.9)
    rounding = rng.uniform(0.03, 0.05) if kind in ("gear", "letter") else rng.uniform(0.06, 0.12)
    dome = rng.uniform(0.08, 0.38) * depth / (polygon**2).sum(1).max()
    body = Extrusion(polygon, depth, rounding, rng.uniform(0.05, 0.2), dome)
    return posed(body.mesh(), rng, (8, 30), 32, 8)


def random_polygon(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Return the corners of a random outline.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (n, 2) ndarray
        Corners, about 2 wide, counter-clockwise, star-shaped about the origin.
    """
    if kind == "letter":
        name = str(rng.choice(list(_LETTERS)))
        return np.array(_LETTERS[name]) - _MIDDLE.get(name, (0, 0))
    turn = np.linspace(0, 2 * np.pi, 721)[:-1] + np.pi / 2
    if kind == "heart":
        points = np.stack(
            [
                16 * np.sin(turn) ** 3,
                13 * np.cos(turn) - 5 * np.cos(2 * turn) - 2 * np.cos(3 * turn) - np.cos(4 * turn),
            ],
            -1,
        )
        return points[::-1] / 16
    if kind == "flower":
        radius = 1 + rng.uniform(0.08, 0.2) * np.cos(int(rng.integers(4, 10)) * turn)
        return radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], -1)
    count = int(
        rng.integers(5, 9)
        if kind == "star"
        else rng.integers(7, 14)
        if kind == "gear"
        else rng.integers(3, 9)
    )
    share, radius = np.zeros(1), np.ones(1)
    if kind == "star":
        share, radius = np.array([0, 0.5]), np.array([1, rng.uniform(0.45, 0.7)])
    if kind == "gear":
        share, radius = (
            np.array([-0.17, 0.17, 0.3, 0.7]),
            np.array([1, 1, *[rng.uniform(0.7, 0.8)] * 2]),
        )
    angle = ((np.arange(count)[:, None] + share) * 2 * np.pi / count).ravel() + np.pi / 2
    return (
        np.tile(radius, count)[:, None]
        * np.stack([np.cos(angle), np.sin(angle)], -1)
        * (1, rng.uniform(0.8, 1))
    )


def smooth_outline(polygon: np.ndarray, rounding: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Round the corners of a polygon and resample it at equal steps.

    Parameters
    ----------
    polygon : (n, 2) ndarray
        Corners, counter-clockwise.
    rounding : float
        Standard deviation of the smoothing along the outline.

    Returns
    -------
    points, normals : (N, 2) ndarray
        The outline with outward unit normals, the first point repeated at the end.
    tightest : float
        Smallest radius of a convex corner.
    """
    fine = 4 * _COLUMNS
    outline = _evenly(polygon, fine)
    length = np.linalg.norm(np.diff(outline, axis=0, append=outline[:1]), axis=1).sum()
    outline = _evenly(
        gaussian_filter1d(outline, rounding * fine / length, axis=0, mode="wrap"), _COLUMNS
    )
    ahead = np.roll(outline, -1, 0) - np.roll(outline, 1, 0)
    step = np.linalg.norm(ahead, axis=1, keepdims=True)
    ahead = ahead / step
    normal = np.stack([ahead[:, 1], -ahead[:, 0]], -1)
    bend = ((np.roll(normal, -1, 0) - np.roll(normal, 1, 0)) * ahead).sum(1) / step[:, 0]
    tightest = 1 / max(float(bend.max()), 1e-3)
    return np.concatenate([outline, outline[:1]]), np.concatenate([normal, normal[:1]]), tightest


def _evenly(polygon: np.ndarray, count: int) -> np.ndarray:
    """`count` points (count, 2) at equal steps along a closed polygon."""
    closed = np.concatenate([polygon, polygon[:1]])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0, length[-1], count, endpoint=False)
    return np.stack([np.interp(at, length, closed[:, i]) for i in range(2)], -1)


def _lifted(plane: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.concatenate([plane, np.broadcast_to(z, plane.shape[:2])[..., None]], -1)


def _bend_normals(bend: np.ndarray, out: np.ndarray, lean: np.ndarray) -> np.ndarray:
    """Normals (rows, columns, 3) of the rounded edge; rows at the angles `lean`, columns along
    `out`.
    """
    ring = bend[:, :-1]
    along = np.roll(ring, -1, 1) - np.roll(ring, 1, 1)
    down = np.cos(lean) * out - np.sin(lean) * (0.0, 0.0, 1.0)
    normals = np.cross(down[:, :-1], along)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.concatenate([normals, normals[:, :1]], 1)


def _mesh(points: np.ndarray, normals: np.ndarray, outward: np.ndarray) -> Mesh:
    """The mesh of a grid (rows, columns, 3): rows from the front's centre to the back's, columns
    counter-clockwise.
    """
    rows, columns = points.shape[:2]
    steps = np.linalg.norm(np.diff(points[_CAP - 1 :], axis=0), axis=-1)
    beyond = np.concatenate([np.zeros((_CAP, columns)), np.cumsum(steps, axis=0)])[:rows, :, None]
    share = np.ones((rows, 1, 1))
    share[-_CAP:, 0, 0] = np.linspace(1, 0, _CAP)
    flat = points[..., :2] + np.where(
        np.arange(rows)[:, None, None] < _CAP,
        0,
        outward * np.minimum(beyond, beyond[-_CAP]) * share,
    )
    flat[_CAP:-_CAP] = points[_CAP - 1, :, :2] + outward * beyond[_CAP:-_CAP]
    seen = flat[: -_CAP - _EDGE]
    low, high = seen.min((0, 1)), seen.max((0, 1))
    uv = np.clip(0.5 + (flat - (low + high) / 2) / (high - low).max() * (1, -1), 0, 1)
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return Mesh(
        points.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), grid_faces(rows, columns)
    )
