"""Simple forms from which bodies are built: balls, rounded boxes, tubes, bodies of revolution and
sheets with a thickness.

All are closed, and even enough in their triangles to be displaced.
"""

from collections.abc import Callable

import numpy as np

from synth.scene.meshes import grid_faces, vertex_normals

from .surface import Surface, welded
from .winding import consistently_wound


def ball(cells: int = 56) -> Surface:
    """Make a unit sphere from a cube whose sides are grids.

    Parameters
    ----------
    cells : int, optional
        Squares along an edge of the cube; there are 12 cells**2 faces.

    Returns
    -------
    Surface
        Welded.
    """
    cube = _cube(cells)
    # The tangent evens out the solid angles of the squares.
    vertices = np.tan(cube.vertices * np.pi / 4)
    return Surface(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), cube.faces)


def rounded_box(half: np.ndarray, radius: float, cells: int = 40) -> Surface:
    """Make a box with rounded edges, centred at the origin.

    Parameters
    ----------
    half : (3,) ndarray
        Half of each side.
    radius : float
        Of the edges; at most the smallest half.
    cells : int, optional
        Squares along an edge.

    Returns
    -------
    Surface
        Welded; its vertices are denser where it is round.
    """
    cube = _cube(cells)
    ramp = np.tanh(1.8 * cube.vertices) / np.tanh(1.8)
    place = ramp * np.asarray(half)
    inner = np.clip(place, -(np.asarray(half) - radius), np.asarray(half) - radius)
    away = place - inner
    length = np.linalg.norm(away, axis=1, keepdims=True)
    return Surface(inner + radius * away / np.where(length > 0, length, 1), cube.faces)


def tube(path: np.ndarray, radius: np.ndarray, sides: int = 16, squash: float = 1.0) -> Surface:
    """Make a tube with round ends along a path.

    Parameters
    ----------
    path : (P, 3) ndarray
        Points of the axis, no two neighbours equal.
    radius : (P,) ndarray
        Of the tube at each point.
    sides : int, optional
        Corners of its cross-section.
    squash : float, optional
        Ratio of the two axes of the cross-section.

    Returns
    -------
    Surface
        Closed, with the ends a little rounded.
    """
    ends = np.sin(np.linspace(0, np.pi / 2, 4))[:-1]
    first, last = _unit(path[0] - path[1]), _unit(path[-1] - path[-2])
    lift = np.sqrt(1 - ends**2)
    path = np.concatenate(
        [
            path[0] + radius[0] * lift[:, None] * first,
            path,
            path[-1] + radius[-1] * lift[::-1, None] * last,
        ]
    )
    radius = np.concatenate([radius[0] * ends, radius, radius[-1] * ends[::-1]])
    normal, binormal = _frames(path)
    angle = np.linspace(0, 2 * np.pi, sides + 1)[None, :, None]
    around = np.cos(angle) * normal[:, None] + squash * np.sin(angle) * binormal[:, None]
    return from_grid(path[:, None] + radius[:, None, None] * around)


def revolved(
    profile: np.ndarray,
    columns: int = 128,
    bend: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
) -> Surface:
    """Make a body of revolution around the y axis.

    Parameters
    ----------
    profile : (P, 2) ndarray
        Radius and height, from axis to axis or in a closed curve.
    columns : int, optional
        Steps around the axis.
    bend : callable, optional
        Factor of the radius from row number (P, 1) and angle (1, columns + 1).

    Returns
    -------
    Surface
        Welded.
    """
    angle = np.linspace(0, 2 * np.pi, columns + 1)[None]
    radius = np.repeat(profile[:, :1], columns + 1, axis=1)
    if bend is not None:
        radius = radius * bend(np.arange(len(profile))[:, None], angle)
    height = np.repeat(profile[:, 1:], columns + 1, axis=1)
    return from_grid(np.stack([radius * np.sin(angle), height, radius * np.cos(angle)], -1))


def sheet(points: np.ndarray, thickness: float) -> Surface:
    """Make a closed sheet from its middle surface.

    Parameters
    ----------
    points : (rows, columns, 3) ndarray
        The middle surface.
    thickness : float
        Of the sheet.

    Returns
    -------
    Surface
        Both sides and the rim.
    """
    rows, columns = points.shape[:2]
    across = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    normals = _unit(across) * thickness / 2
    number = np.arange(rows * columns).reshape(rows, columns)
    rim = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    ahead, back = np.roll(rim, -1), rows * columns
    faces = grid_faces(rows, columns)
    return Surface(
        np.concatenate([(points + normals).reshape(-1, 3), (points - normals).reshape(-1, 3)]),
        np.concatenate(
            [
                faces,
                faces[:, ::-1] + back,
                np.stack([rim, ahead, rim + back], -1),
                np.stack([ahead, ahead + back, rim + back], -1),
            ]
        ),
    )


def from_grid(points: np.ndarray) -> Surface:
    """Make a surface from a grid of points; equal ones are merged, and faces turned outward.

    Parameters
    ----------
    points : (rows, columns, 3) ndarray
        The grid.

    Returns
    -------
    Surface
        Welded.
    """
    rows, columns = points.shape[:2]
    return consistently_wound(welded(Surface(points.reshape(-1, 3), grid_faces(rows, columns)))[0])


def displaced(surface: Surface, amount: np.ndarray) -> Surface:
    """Move vertices along their normals.

    Parameters
    ----------
    surface : Surface
        Welded.
    amount : (N,) ndarray
        Of each vertex.

    Returns
    -------
    Surface
        The same faces.
    """
    normals = vertex_normals(surface.vertices, surface.faces)
    return Surface(surface.vertices + amount[:, None] * normals, surface.faces)


def placed(
    surface: Surface,
    at: np.ndarray | tuple[float, float, float] = (0, 0, 0),
    scale: np.ndarray | tuple[float, float, float] | float = 1.0,
    turn: np.ndarray | None = None,
) -> Surface:
    """Scale, turn and move a surface, in this order.

    Parameters
    ----------
    surface : Surface
        The surface.
    at : (3,) array_like, optional
        Where its origin goes.
    scale : float or (3,) array_like, optional
        Positive factors.
    turn : (3, 3) ndarray, optional
        Rotation matrix.

    Returns
    -------
    Surface
        The same faces.
    """
    vertices = surface.vertices * np.asarray(scale)
    if turn is not None:
        vertices = vertices @ turn.T
    return Surface(vertices + np.asarray(at), surface.faces)


def curve(points: np.ndarray, count: int) -> np.ndarray:
    """Return a smooth curve through points.

    Parameters
    ----------
    points : (K, D) ndarray
        At least two.
    count : int
        Number of points to return.

    Returns
    -------
    (count, D) ndarray
        From the first point to the last, by a cubic spline without a kink.
    """
    from scipy.interpolate import PchipInterpolator

    points = np.asarray(points, float)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0], np.cumsum(np.maximum(steps, 1e-9))])
    return np.asarray(PchipInterpolator(along, points)(np.linspace(0, along[-1], count)))


def _cube(cells: int) -> Surface:
    """The cube from -1 to 1, welded."""
    side = np.linspace(-1, 1, cells + 1)
    u, v = (axis.ravel() for axis in np.meshgrid(side, side, indexing="ij"))
    one, faces = np.ones_like(u), grid_faces(cells + 1, cells + 1)
    sides: list[np.ndarray] = []
    triangles: list[np.ndarray] = []
    for k in range(3):
        for sign in (-1, 1):
            points = np.roll(np.stack([sign * one, u, v], -1), k, axis=1)
            triangles.append((faces if sign > 0 else faces[:, ::-1]) + len(sides) * len(u))
            sides.append(points)
    return welded(Surface(np.concatenate(sides), np.concatenate(triangles)))[0]


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))


def _frames(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals and binormals (P, 3) along a path, turned as little as possible."""
    tangent = _unit(np.gradient(path, axis=0))
    normal = np.empty_like(path)
    start = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    for k, along in enumerate(tangent):
        start = _unit(start - (start @ along) * along)
        normal[k] = start
    return normal, np.cross(tangent, normal)
