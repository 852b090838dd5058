"""Rules that reject meshes that are unsuitable for training.

| rule | thrown out |
| --- | --- |
| DEGENERATE | fewer than FEWEST faces with area, or vertices that are not finite |
| HUGE | more than MOST faces |
| FLAT | smallest extent along the principal axes below FLATTEST of the largest |
| SCRAPS | more than MOST_PIECES pieces, and none has PIECE of the area: foliage, gravel, fringes |
| INSIDE | less than SEEN of the area is seen from outside: rooms, engines |

"Seen": of points uniform over the area, those that are the nearest one, or within a cell of it, in
a cell of a depth map of CELLS x CELLS cells, from one of 14 directions (faces and corners of a
cube).

Limits: the depth maps are coarse, and a point behind a gap narrower than a cell counts as hidden.
"""

from enum import StrEnum
from itertools import product

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from isc_core.errors import InputError

from .geometry.surface import Surface, welded

FEWEST, MOST = 12, 70_000
FLATTEST = 0.02
MOST_PIECES, PIECE = 150, 0.05
SEEN = 0.35
POINTS, CELLS = 12_000, 16


class Fault(StrEnum):
    """Why a body is thrown out."""

    DEGENERATE = "degenerate"
    HUGE = "huge"
    FLAT = "flat"
    SCRAPS = "scraps"
    INSIDE = "inside"


def checked(surface: Surface, name: str) -> Surface:
    """Return a surface that has faces.

    Parameters
    ----------
    surface : Surface
        As read from a file.
    name : str
        For the message.

    Returns
    -------
    Surface
        The surface given.

    Raises
    ------
    InputError
        If it has no face with an area. An area that is not a number is left to `fault`.
    """
    if not len(surface.faces) or surface.areas().sum() == 0:
        raise InputError(f"{name} has no surface: give a file with triangles of some area")
    return surface


def fault(surface: Surface) -> Fault | None:
    """Return the first rule that a body breaks.

    Parameters
    ----------
    surface : Surface
        The body.

    Returns
    -------
    Fault or None
        None for a suitable body.
    """
    if not np.isfinite(surface.vertices).all() or len(surface.faces) < FEWEST:
        return Fault.DEGENERATE
    if len(surface.faces) > MOST:
        return Fault.HUGE
    surface = welded(surface)[0]
    if len(surface.faces) < FEWEST:
        return Fault.DEGENERATE
    if flatness(surface) < FLATTEST:
        return Fault.FLAT
    if _is_scraps(surface):
        return Fault.SCRAPS
    return Fault.INSIDE if seen_share(surface) < SEEN else None


def flatness(surface: Surface) -> float:
    """Return the smallest extent along the principal axes over the largest.

    Parameters
    ----------
    surface : Surface
        The body.

    Returns
    -------
    float
        0 for a plane, 1 for a sphere.
    """
    centred = surface.vertices - surface.vertices.mean(0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    extents = np.ptp(centred @ axes, axis=0)
    return float(extents.min() / extents.max())


def seen_share(surface: Surface) -> float:
    """Return the share of the area that is seen from outside.

    Parameters
    ----------
    surface : Surface
        The body.

    Returns
    -------
    float
        In [0, 1].
    """
    rng = np.random.default_rng(0)
    areas = surface.areas()
    face = rng.choice(len(areas), POINTS, p=areas / areas.sum())
    corners = surface.corners()[face]
    points = np.einsum("ij,ijk->ik", rng.dirichlet((1, 1, 1), POINTS), corners)
    seen = np.zeros(POINTS, bool)
    for toward in _directions():
        seen |= _nearest(points, toward)
    return float(seen.mean())


def _directions() -> np.ndarray:
    """Unit vectors (14, 3) to the faces and corners of a cube."""
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    return np.concatenate([faces, np.array(list(product((-1, 1), repeat=3))) / np.sqrt(3)])


def _nearest(points: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Points that are the first ones, or nearly, in a depth map from a direction."""
    across = np.linalg.svd(toward[None])[2][1:]
    plane, depth = points @ across.T, points @ toward
    cell = np.ptp(plane, axis=0).max() / CELLS + 1e-12
    rows, columns = np.floor((plane - plane.min(0)) / cell).astype(int).T
    number = rows * (CELLS + 2) + columns
    front = np.full(number.max() + 1, -np.inf)
    np.maximum.at(front, number, depth)
    return np.asarray(depth >= front[number] - cell)


def _is_scraps(surface: Surface) -> bool:
    a, b, c = surface.faces.T
    count = len(surface.vertices)
    graph = coo_matrix(
        (np.ones(2 * len(a), np.int8), (np.concatenate([a, b]), np.concatenate([b, c]))),
        shape=(count, count),
    )
    number, label = connected_components(graph, directed=False)
    areas = np.bincount(label[a], surface.areas(), number)
    return bool(number > MOST_PIECES and areas.max() < PIECE * areas.sum())
