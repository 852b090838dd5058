"""Surfaces of revolution, as made on a lathe or potter's wheel: vases, bottles, bowls, cups,
apples, pawns, eggs.

Equation: the outline (r(s), y(s)), s its length, is a monotone cubic through a few points, smoothed
by a Gaussian over s and revolved about the y axis: (r sin a, y, r cos a). Beyond a pole the outline
continues on the other side (r changes its sign), which keeps the poles round. Hollow forms have an
inner wall, which meets the outer one at the rim.

Citation: F. N. Fritsch and J. Butland, "A method for constructing local monotone piecewise cubic
interpolants", SIAM Journal on Scientific and Statistical Computing 5 (1984), doi:10.1137/0905021.

Limits: smooth everywhere: no edge is sharper than the smoothing.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from ..scene.meshes import Mesh, joined, swept
from .posing import posed

_ROWS, _COLUMNS = 360, 193

# Outlines (radius, height) from the upper pole to the lower one; of hollow forms from the rim.
_SOLID = {
    "apple": [
        (0, 0.60),
        (0.06, 0.64),
        (0.22, 0.78),
        (0.45, 0.84),
        (0.72, 0.75),
        (0.93, 0.45),
        (0.97, 0.1),
        (0.86, -0.3),
        (0.62, -0.65),
        (0.4, -0.83),
        (0.2, -0.85),
        (0.08, -0.8),
        (0, -0.78),
    ],
    "egg": [(0, 1), (0.3, 0.93), (0.55, 0.62), (0.7, 0.1), (0.66, -0.35), (0.4, -0.68), (0, -0.8)],
    "pear": [
        (0, 0.95),
        (0.14, 0.95),
        (0.28, 0.8),
        (0.34, 0.5),
        (0.45, 0.2),
        (0.66, -0.15),
        (0.72, -0.5),
        (0.52, -0.82),
        (0.15, -0.9),
        (0, -0.87),
    ],
    "pawn": [
        (0, 1),
        (0.2, 0.95),
        (0.27, 0.78),
        (0.2, 0.6),
        (0.15, 0.54),
        (0.33, 0.48),
        (0.33, 0.42),
        (0.18, 0.34),
        (0.2, 0),
        (0.3, -0.35),
        (0.32, -0.42),
        (0.46, -0.5),
        (0.48, -0.62),
        (0.5, -0.75),
        (0.47, -0.8),
        (0, -0.8),
    ],
    "jar": [
        (0, 0.98),
        (0.09, 0.95),
        (0.12, 0.86),
        (0.08, 0.8),
        (0.2, 0.76),
        (0.5, 0.66),
        (0.54, 0.58),
        (0.5, 0.52),
        (0.66, 0.35),
        (0.74, 0.05),
        (0.7, -0.3),
        (0.5, -0.7),
        (0.46, -0.78),
        (0.5, -0.85),
        (0.46, -0.88),
        (0, -0.88),
    ],
    "bell": [
        (0, 1),
        (0.1, 0.97),
        (0.13, 0.85),
        (0.07, 0.76),
        (0.3, 0.68),
        (0.48, 0.5),
        (0.54, 0.1),
        (0.62, -0.3),
        (0.86, -0.62),
        (0.88, -0.7),
        (0, -0.68),
    ],
}
_HOLLOW = {
    "vase": [
        (0.3, 1),
        (0.22, 0.78),
        (0.26, 0.6),
        (0.55, 0.25),
        (0.64, -0.1),
        (0.52, -0.55),
        (0.36, -0.9),
        (0.38, -1),
        (0, -1),
    ],
    "amphora": [
        (0.34, 1),
        (0.3, 0.9),
        (0.2, 0.72),
        (0.3, 0.52),
        (0.62, 0.2),
        (0.58, -0.25),
        (0.3, -0.75),
        (0.3, -0.95),
        (0, -0.95),
    ],
    "bottle": [
        (0.15, 1),
        (0.17, 0.92),
        (0.14, 0.85),
        (0.15, 0.45),
        (0.22, 0.3),
        (0.42, 0.1),
        (0.45, -0.1),
        (0.45, -0.9),
        (0.4, -0.98),
        (0, -0.98),
    ],
    "bowl": [
        (1, 0.45),
        (0.96, 0.2),
        (0.8, -0.15),
        (0.5, -0.38),
        (0.36, -0.42),
        (0.36, -0.52),
        (0, -0.52),
    ],
    "cup": [(0.72, 0.8), (0.72, 0.2), (0.7, -0.4), (0.62, -0.7), (0.5, -0.78), (0, -0.78)],
    "goblet": [
        (0.55, 1),
        (0.6, 0.6),
        (0.5, 0.25),
        (0.2, 0.02),
        (0.1, -0.1),
        (0.09, -0.5),
        (0.2, -0.66),
        (0.5, -0.75),
        (0.5, -0.82),
        (0, -0.82),
    ],
    "pot": [
        (0.62, 0.6),
        (0.55, 0.5),
        (0.72, 0.3),
        (0.86, -0.05),
        (0.78, -0.4),
        (0.5, -0.68),
        (0.45, -0.74),
        (0, -0.74),
    ],
}
FORMS = (*_SOLID, *_HOLLOW)
_ABOVE = {
    "bowl": (18, 38),
    "apple": (20, 40),
    "cup": (14, 28),
}  # elevation of the camera, degrees


def lathe(rng: np.random.Generator) -> Mesh:
    """Make a random form, posed.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Mesh
        One of `FORMS`, centred; the larger extent in the picture is 2 object units.
    """
    return lathe_form(str(rng.choice(FORMS)), rng)


def lathe_form(name: str, rng: np.random.Generator) -> Mesh:
    """Make a form with random proportions, posed. Most cups have a handle.

    Parameters
    ----------
    name : str
        One of `FORMS`.
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Mesh
        The object.
    """
    wide, tall = np.exp(rng.normal(size=2) * (0.14, 0.1))
    base = np.array(_SOLID.get(name) or _HOLLOW[name], float) * (wide, tall)
    base[1:-1, 0] *= np.exp(0.035 * rng.normal(size=len(base) - 2))
    wall = rng.uniform(0.05, 0.08)
    outline = base if name in _SOLID else hollow(base, wall)
    body = revolved(outline, smoothing=rng.uniform(0.02, 0.05) if name in _SOLID else 0.3 * wall)
    if name == "cup" and rng.random() < 0.75:
        half = 0.45 * tall
        ends = PchipInterpolator(base[-2::-1, 1], base[-2::-1, 0])((half, -half)) - wall / 2
        body = joined(body, _handle(ends, half, rng))
        return posed(
            body.rotated(Rotation.from_euler("y", rng.uniform(-55, 55), degrees=True).as_matrix()),
            rng,
            _ABOVE["cup"],
            1,
        )
    lean = 25 if name in ("egg", "pear") else 4
    return posed(body, rng, _ABOVE.get(name, (5, 25)), 10, lean)


def hollow(outer: np.ndarray, wall: float) -> np.ndarray:
    """Add an inner wall to the outline of a vessel.

    Parameters
    ----------
    outer : (n, 2) ndarray
        Radius and height of the outer wall, from the rim to the lower pole.
    wall : float
        Thickness of the wall.

    Returns
    -------
    (m, 2) ndarray
        The outline from the inner floor over the rim to the lower pole; solid, closed at the top,
        if even the rim is too narrow for a wall.
    """
    side = outer[:-1]
    floor = side[-1, 1] + 2 * wall
    fine = np.linspace(side[0, 1] - wall / 2, floor + wall, 60)
    upward = np.argsort(side[:, 1], kind="stable")
    heights, first = np.unique(side[upward, 1], return_index=True)
    radius = PchipInterpolator(heights, side[upward, 0][first])(fine) - wall
    # A narrow foot or neck is too narrow for an inner wall: the inside ends above it.
    room = np.argmax(radius < wall) if (radius < wall).any() else len(fine)
    if room == 0:
        return np.concatenate([[(0, outer[0, 1])], outer])
    inner = np.stack([radius, fine], -1)[:room]
    bottom = (0.6 * inner[-1, 0], inner[-1, 1] - wall)
    return np.concatenate(
        [
            [(0, bottom[1])],
            [bottom],
            inner[::-1],
            side[:1] - (wall / 2, -wall / 8),
            side,
            outer[-1:],
        ]
    )


def revolved(outline: np.ndarray, smoothing: float) -> Mesh:
    """Make the surface of revolution of an outline.

    Parameters
    ----------
    outline : (n, 2) ndarray
        Radius and height; begins and ends on the axis.
    smoothing : float
        Standard deviation of the smoothing, in units of the outline.

    Returns
    -------
    Mesh
        The surface. Texture coordinates are mirrored behind (u) and at the top (v).
    """
    steps = np.linalg.norm(np.diff(outline, axis=0), axis=1)
    length = np.concatenate([[0], np.cumsum(steps)])
    radius, height = PchipInterpolator(length, outline)(np.linspace(0, length[-1], _ROWS)).T
    margin, width = _ROWS // 4, smoothing * _ROWS / length[-1]
    height = gaussian_filter1d(np.pad(height, margin, mode="reflect"), width)[margin:-margin]
    radius = np.maximum(
        gaussian_filter1d(np.pad(radius, margin, mode="reflect", reflect_type="odd"), width)[
            margin:-margin
        ],
        0,
    )
    radius[[0, -1]] = 0
    turn = np.linspace(-np.pi, np.pi, _COLUMNS)  # it begins behind
    across, deep = np.sin(turn), np.cos(turn)
    across[[0, -1]] = 0
    points = np.stack(
        [
            radius[:, None] * across,
            np.broadcast_to(height[:, None], (_ROWS, _COLUMNS)),
            radius[:, None] * deep,
        ],
        -1,
    )
    mesh = swept(points)
    return Mesh(mesh.vertices, mesh.normals, _coordinates(radius, height, turn), mesh.faces)


def _coordinates(radius: np.ndarray, height: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Coordinates with equal scale along u and v where the form is wide.

    The texture appears once, on the front of the outside.
    """
    top = int(height.argmax())
    length = np.concatenate([[0], np.cumsum(np.hypot(np.diff(radius), np.diff(height)))])
    down = np.abs(length - length[top])
    girth = np.pi * np.quantile(radius[top:], 0.8)
    whole = max(girth, down[-1])
    folded = np.where(np.abs(turn) > np.pi / 2, np.sign(turn) * np.pi - turn, turn) / np.pi
    u, v = np.meshgrid(0.5 + 0.99 * folded * girth / whole, 0.5 + (down - down[-1] / 2) / whole)
    return np.clip(np.stack([u.ravel(), v.ravel()], -1), 0, 1)


def _handle(ends: np.ndarray, half: float, rng: np.random.Generator) -> Mesh:
    """A bent tube, closed at both ends, that leaves a wall toward +x at the radii `ends` (2,) and
    the heights half and -half.
    """
    along = np.linspace(0, 1, 90)
    out = rng.uniform(0.4, 0.6)
    path = np.stack(
        [
            ends[0]
            + (ends[1] - ends[0]) * along
            + out * np.sin(np.pi * along) ** rng.uniform(0.6, 1.0),
            half * np.cos(np.pi * along),
        ],
        -1,
    )
    toward = np.gradient(path, axis=0)
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    turn = np.linspace(0, 2 * np.pi, 49)
    thick = np.sqrt(np.clip(1 - np.abs(2 * along - 1) ** 24, 0, 1))[:, None]
    thick[[0, -1]] = 0
    flat, deep = 0.055 * thick * np.cos(turn), 0.09 * thick * np.sin(turn)
    points = np.stack(
        [path[:, :1] + flat * toward[:, 1:], path[:, 1:] - flat * toward[:, :1], deep], -1
    )
    points[:, -1] = points[:, 0]
    mesh = swept(points)
    normals = mesh.normals.reshape(points.shape).copy()
    normals[0], normals[-1] = [np.append(end, 0) for end in (-toward[0], toward[-1])]
    return Mesh(
        mesh.vertices, normals.reshape(-1, 3), np.full((points[..., 0].size, 2), 0.5), mesh.faces
    )
