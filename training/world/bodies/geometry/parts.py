"""Taking a model apart into separate items.

Equation: a piece is a set of faces connected by shared vertices. Two pieces touch if points spread
over both fall into the same cell of one of two cubic grids, offset by half a cell, of CELL times
the model's longest side. Pieces that touch are one item. A named object of the file, or what
touches within it, is an item of its own too if the largest face of its bounding box is below
PORTION of its item's: the vase on the shelf, the shade of a lamp. Items below SHARE of the longest
one are dropped, and objects of less than FACES faces. Of the rest at most `most` are kept, the
largest first; one whose relative extents and area are those of a larger one is dropped: the second
of two equal chairs. Models of more than OBJECTS named objects are taken apart by contact alone.

Limits: items that stand on a common floor plate are one item with it, and items of their own only
if the file names them. Gaps narrower than a cell close.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .surface import Surface

CELL = 0.015  # relative to the longest side of the model
SHARE, FACES, PORTION, OBJECTS = 0.15, 150, 0.6, 200
ALIKE = 0.02  # relative difference up to which two items are of one shape
_POINTS = 12_000


def separate_items(surface: Surface, objects: np.ndarray, most: int) -> list[Surface]:
    """Take a model apart.

    Parameters
    ----------
    surface : Surface
        On merged vertices.
    objects : (M,) ndarray of int
        The file's named object of each face.
    most : int
        Number of items to return at most.

    Returns
    -------
    list of Surface
        The largest first; none equal in shape.
    """
    piece = _pieces(surface)
    touching = _contacts(surface, piece)
    item = _joined(int(piece.max()) + 1, touching)[piece]
    boxes = _extents(surface, item)
    size = np.sort(boxes, axis=1)[:, 1:].prod(1)  # the largest face of each box
    found = [item == k for k in np.argsort(-size, kind="stable")[: 2 * most]]
    named = np.unique(objects)
    for k in named if len(named) <= OBJECTS else ():
        own = _largest_within(objects == k, item)
        own = _touching_part(own, piece, touching)
        whole = size[item[np.argmax(own)]]
        if own.sum() >= FACES and _face_of_box(surface.part(own)) < PORTION * whole:
            found.append(own)
    items = [surface.part(one) for one in found]
    least = SHARE * max(one.extents().max() for one in items)
    items = [one for one in items if one.extents().max() > least]
    return _of_different_shape(sorted(items, key=_face_of_box, reverse=True), most)


def _extents(surface: Surface, label: np.ndarray) -> np.ndarray:
    """Sides (K, 3) of the bounding box of the faces of each label, all of which occur."""
    order = np.argsort(label, kind="stable")
    starts = np.searchsorted(label[order], np.arange(label.max() + 1))
    corners = surface.corners()[order]
    high = np.maximum.reduceat(corners.max(1), starts)
    return np.asarray(high - np.minimum.reduceat(corners.min(1), starts))


def _largest_within(own: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Of some faces, those of the label that has the most of them."""
    return np.asarray(own & (label == np.argmax(np.bincount(label[own]))))


def _touching_part(own: np.ndarray, piece: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """Of some faces, those that hang together without the others' help: the most there are."""
    numbers, local = np.unique(piece[own], return_inverse=True)
    if len(numbers) == 1:
        return own
    inside = np.isin(touching, numbers).all(1)
    part = _joined(len(numbers), np.searchsorted(numbers, touching[inside]))[local]
    chosen = own.copy()
    chosen[own] = part == np.argmax(np.bincount(part))
    return chosen


def largest_piece(surface: Surface) -> Surface:
    """Return the piece of the largest area.

    Parameters
    ----------
    surface : Surface
        On merged vertices.

    Returns
    -------
    Surface
        Connected by shared vertices.
    """
    piece = _pieces(surface)
    return surface.part(piece == np.argmax(np.bincount(piece, surface.areas())))


def _pieces(surface: Surface) -> np.ndarray:
    """Number (M,) of the piece of each face."""
    a, b, c = surface.faces.T
    graph = coo_matrix(
        (np.ones(2 * len(a), np.int8), (np.concatenate([a, b]), np.concatenate([b, c]))),
        shape=(len(surface.vertices),) * 2,
    )
    return np.asarray(connected_components(graph, directed=False)[1][a])


def _contacts(surface: Surface, piece: np.ndarray) -> np.ndarray:
    """Pairs (P, 2) of pieces with points in a common cell."""
    points, owner = _spread(surface, piece)
    pairs = []
    for offset in (0.0, 0.5):
        cells = np.floor(points / (CELL * surface.extents().max()) + offset).astype(np.int64)
        number = np.ravel_multi_index(tuple((cells - cells.min(0)).T), tuple(np.ptp(cells, 0) + 1))
        order = np.lexsort([owner, number])
        beside = number[order[1:]] == number[order[:-1]]
        pairs.append(np.stack([owner[order[1:]], owner[order[:-1]]], -1)[beside])
    return np.unique(np.concatenate([*pairs, np.stack([piece, piece], -1)]), axis=0)


def _spread(surface: Surface, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners and points uniform over the area, and the piece of each."""
    rng = np.random.default_rng(0)
    areas = surface.areas()
    face = np.repeat(np.arange(len(areas)), np.ceil(_POINTS * areas / areas.sum()).astype(int))
    weights = rng.dirichlet((1, 1, 1), len(face))
    inside = np.einsum("ij,ijk->ik", weights, surface.corners()[face])
    corners = surface.vertices[surface.faces.ravel()]
    return np.concatenate([corners, inside]), np.concatenate([np.repeat(piece, 3), piece[face]])


def _joined(count: int, pairs: np.ndarray) -> np.ndarray:
    """Number of the item of each of `count` pieces, from the pairs that belong together."""
    graph = coo_matrix((np.ones(len(pairs), np.int8), tuple(pairs.T)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _face_of_box(surface: Surface) -> float:
    """Product of the two larger sides of the bounding box: also a size of flat items."""
    return float(np.sort(surface.extents())[1:].prod())


def _of_different_shape(items: list[Surface], most: int) -> list[Surface]:
    kept: list[Surface] = []
    signatures: list[np.ndarray] = []
    for item in items:
        if len(kept) == most:
            break
        size = item.extents().max()
        signature = np.log(
            [*(np.sort(item.extents()) / size + 0.01), item.areas().sum() / size**2 + 0.01]
        )
        if all(np.abs(signature - other).max() > ALIKE for other in signatures):
            kept.append(item)
            signatures.append(signature)
    return kept
