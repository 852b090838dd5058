"""Things put together of bodies of other kinds: parts on a base, and heaps.

Most things that people photograph consist of several parts, or are several things that touch. Their
edges of occlusion, contacts and sudden changes of curvature do not occur in bodies of one piece.

Equation: a part sits on the base at a point p drawn by area, its axis along the normal n there; it
is repeated at other points, on a creature by reflection in the plane x = 0, on a body of revolution
by rotations around its axis. Items of a heap fall one after the other: with h the highest points so
far, and l the lowest ones of the item, both in cells over the plane, it is lowered by min(l - h).

Citation: reduction of triangles: M. Garland and P. S. Heckbert 1997, doi:10.1145/258734.258849, by
Blender's decimate modifier.

Limits: items do not roll or turn, so that some stand as they would not stand.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.blender import emptied, mesh_object, surface_of
from ..geometry.forms import placed, revolved
from ..geometry.surface import Surface, fitted, together
from . import booleans, boxes, creatures, fruit, lathes, metaballs, pouches, rocks, shells, skins

_FACES = 60_000  # of the whole
_CELLS = 48  # along the longer side of a heap
_SUNK = 0.02  # items of a heap touch in more than a point
_MAKERS: tuple[Callable[[np.random.Generator], Surface], ...] = (
    booleans.make,
    boxes.make,
    creatures.make,
    fruit.make,
    lathes.make,
    metaballs.make,
    pouches.make,
    rocks.make,
    shells.make,
    skins.make,
)


def make(rng: np.random.Generator) -> Surface:
    """Make a base with parts, or a heap.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    return _heap(rng) if rng.random() < 0.4 else _base_with_parts(rng)


def _part(rng: np.random.Generator, maker: int, faces: int) -> Surface:
    """A body of some kind with at most so many faces, its longest side 2."""
    part = fitted(_MAKERS[maker](rng))
    if len(part.faces) <= faces:
        return part
    obj = mesh_object(emptied(), part)
    decimate = obj.modifiers.new("decimate", "DECIMATE")
    decimate.ratio = faces / len(part.faces)
    return surface_of(obj)


def _base_with_parts(rng: np.random.Generator) -> Surface:
    kind = int(rng.integers(len(_MAKERS)))
    base = fitted(placed(_part(rng, kind, _FACES // 2), scale=rng.uniform(0.6, 1.2, 3)))
    pieces, count = [base], int(rng.integers(1, 4))
    for _ in range(count):
        repeats = int(rng.choice([1, 2, 3, 4, 6], p=[0.4, 0.3, 0.1, 0.1, 0.1]))
        part = _part(rng, int(rng.integers(len(_MAKERS))), _FACES // 2 // count // repeats)
        scale = rng.uniform(0.35, 1.0) / 2 / repeats**0.5
        first = _attached(part, base, scale, rng)
        if _MAKERS[kind] is lathes.make:
            pieces += _around(first, repeats)
        elif _MAKERS[kind] is creatures.make:
            pieces += [first, _reflected(first)]
        else:
            others = [_attached(part, base, scale, rng) for _ in range(repeats - 1)]
            pieces += [first, *others]
    return together(pieces)


def _attached(part: Surface, base: Surface, scale: float, rng: np.random.Generator) -> Surface:
    """A part on the base, its y axis along the normal or, often, upright."""
    corners, areas = base.corners(), base.areas()
    a, b, c = corners[rng.choice(len(areas), p=areas / areas.sum())]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    if normal @ a < 0:  # files and makers wind faces either way
        normal = -normal
    along = normal if rng.random() < 0.7 else np.array([0.0, 1, 0])
    turn, _ = Rotation.align_vectors(along[None], np.array([[0.0, 1, 0]]))
    turned = turn * Rotation.from_rotvec([0, rng.uniform(0, 2 * np.pi), 0])
    out = rng.uniform(0.1, 0.9) * scale * part.extents()[1] / 2
    return placed(part, (a + b + c) / 3 + out * normal, scale, turned.as_matrix())


def _reflected(part: Surface) -> Surface:
    return Surface(part.vertices * (-1, 1, 1), part.faces[:, ::-1])


def _around(part: Surface, count: int) -> list[Surface]:
    angles = 2 * np.pi * np.arange(count) / count
    return [placed(part, turn=Rotation.from_rotvec([0, angle, 0]).as_matrix()) for angle in angles]


def _heap(rng: np.random.Generator) -> Surface:
    count, kind = int(rng.integers(3, 10)), int(rng.integers(len(_MAKERS)))
    alike, spread = rng.random() < 0.6, rng.uniform(0.25, 0.7) * count**0.5
    pieces = [_dish(spread, rng)] if rng.random() < 0.5 else []
    for _ in range(count):
        maker = kind if alike else int(rng.integers(len(_MAKERS)))
        turn = Rotation.random(random_state=rng).as_matrix()
        x, z = spread * np.sqrt(rng.random()) * _on_circle(rng)
        item = _part(rng, maker, _FACES // (count + 1))
        pieces.append(_fallen(placed(item, (x, 0, z), rng.uniform(0.35, 0.7), turn), pieces))
    return together(pieces)


def _on_circle(rng: np.random.Generator) -> np.ndarray:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def _fallen(item: Surface, pieces: list[Surface]) -> Surface:
    """The item, lowered until it touches the ground at y = 0 or one of the pieces."""
    low = item.vertices[:, 1].min()
    if pieces:
        plane = np.concatenate([one.vertices for one in [*pieces, item]])[:, ::2]
        corner, cell = plane.min(0), np.ptp(plane, axis=0).max() / _CELLS
        ground = _highest(pieces, corner, cell)
        below = -_highest([placed(item, scale=(1, -1, 1))], corner, cell)
        both = np.isfinite(ground) & np.isfinite(below)
        low = min(low, (below - np.maximum(ground, 0))[both].min(initial=np.inf))
    return placed(item, (0, -low - _SUNK, 0))


def _highest(surfaces: list[Surface], corner: np.ndarray, cell: float) -> np.ndarray:
    """The highest vertex above each cell of the plane; minus infinity without any."""
    found = np.full((_CELLS + 1, _CELLS + 1), -np.inf)
    for one in surfaces:
        column, row = ((one.vertices[:, ::2] - corner) / cell).astype(int).T
        np.maximum.at(found, (row, column), one.vertices[:, 1])
    return found


def _dish(spread: float, rng: np.random.Generator) -> Surface:
    """A plate, bowl or board below the heap, its inside from y = 0 on."""
    wide, high = spread + rng.uniform(-0.1, 0.6), rng.choice([0.0, rng.uniform(0.05, 0.5) * spread])
    thick, power = rng.uniform(0.02, 0.08), rng.uniform(1.5, 6)
    radius = np.linspace(0, wide, 24)
    rise = high * (radius / wide) ** power
    inside = np.stack([radius, rise], -1)
    outside = np.stack([radius, rise - thick], -1)
    return revolved(np.concatenate([inside, outside[::-1]]), 96)
