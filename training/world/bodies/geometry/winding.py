"""Consistent winding of faces, outward where that has a meaning.

Equation: every face f has two copies, f+ as drawn and f- turned over. Across each shared edge,
copies that agree in direction are joined: f+ with g+ and f- with g- if the faces run along the edge
in opposite directions, else f+ with g- and f- with g+. A connected component of the copies is one
of the two consistent windings of its faces; the one of positive volume about the component's
centroid is kept.

Limits: a surface that cannot be oriented (a Moebius strip) stays as drawn. On an open one, the sign
of the volume is a guess.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .edges import shared_edges
from .surface import Surface


def consistently_wound(surface: Surface) -> Surface:
    """Turn faces over until neighbours agree and every component's volume is positive.

    Parameters
    ----------
    surface : Surface
        On merged vertices.

    Returns
    -------
    Surface
        The same faces in the same order.
    """
    edges, count = shared_edges(surface.faces), len(surface.faces)
    f, g = edges.faces.T
    turn = np.where(edges.opposite, 0, count)
    graph = coo_matrix(
        (
            np.ones(2 * len(f), np.int8),
            (np.concatenate([f, f + count]), np.concatenate([g + turn, g + count - turn])),
        ),
        shape=(2 * count, 2 * count),
    )
    number, label = connected_components(graph, directed=False)
    as_drawn, turned = label[:count], label[count:]
    volumes = _volumes(surface, np.minimum(as_drawn, turned))
    volume = np.bincount(as_drawn, volumes, number) - np.bincount(turned, volumes, number)
    # Both windings of a component have opposite volumes; at 0 the first one is kept.
    over = (volume[as_drawn] < volume[turned]) | (
        (volume[as_drawn] == volume[turned]) & (as_drawn > turned)
    )
    return Surface(surface.vertices, np.where(over[:, None], surface.faces[:, ::-1], surface.faces))


def _volumes(surface: Surface, label: np.ndarray) -> np.ndarray:
    """Signed volume of each face's tetrahedron to the centroid of its component's corners."""
    corners = surface.corners()
    count = np.maximum(np.bincount(label), 1)
    centroid = np.stack([np.bincount(label, corners.mean(1)[:, k]) / count for k in range(3)], -1)
    a, b, c = np.moveaxis(corners - centroid[label][:, None], 1, 0)
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
