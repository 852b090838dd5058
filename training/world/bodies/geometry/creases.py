"""Vertex normals that are smooth, except across sharp edges.

Equation: two faces are smooth together where they share an edge and their normals meet at less than
CREASE. Corners at a vertex that are connected by such edges are one vertex of the mesh; its normal
is that of its faces alone, weighted by their areas. With the weights of
`synth.scene.meshes.vertex_normals`, the many small triangles of a bevel would bend the flat face
beside it.

Limits: at the end of a crease, inside a surface, the corners on both sides are connected around the
end, so the normal there is smooth.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from synth.scene.meshes import Mesh

from .edges import shared_edges
from .surface import Surface

CREASE = 40.0  # degrees between the normals of neighbouring faces; above it their edge is sharp


def creased(surface: Surface, crease: float = CREASE) -> Mesh:
    """Make a mesh with smooth normals and sharp edges.

    Parameters
    ----------
    surface : Surface
        On merged vertices, consistently wound.
    crease : float, optional
        Angle of a sharp edge, degrees.

    Returns
    -------
    Mesh
        The same faces in the same order; its `uv` are zeros.
    """
    edges, count = shared_edges(surface.faces), len(surface.faces)
    areas = _areas(surface)
    normals = _normalised(areas)
    f, g = edges.faces.T
    cosine = np.einsum("ij,ij->i", normals[f], normals[g])
    smooth = edges.opposite & (cosine > np.cos(np.radians(crease)))
    (f, g), (i, j) = edges.faces[smooth].T, edges.corners[smooth].T
    # Opposite directions: the edge starts for one face where it ends for the other.
    first = np.concatenate([3 * f + i, 3 * f + (i + 1) % 3])
    second = np.concatenate([3 * g + (j + 1) % 3, 3 * g + j])
    graph = coo_matrix(
        (np.ones(len(first), np.int8), (first, second)), shape=(3 * count, 3 * count)
    )
    _, corner = connected_components(graph, directed=False)
    _, where, number = np.unique(corner, return_index=True, return_inverse=True)
    vertices = surface.vertices[surface.faces.ravel()[where]]
    faces = number.reshape(-1, 3)
    sums = np.zeros_like(vertices)
    np.add.at(sums, faces.ravel(), np.repeat(areas, 3, axis=0))
    return Mesh(vertices, _normalised(sums), np.zeros((len(vertices), 2)), faces)


def _areas(surface: Surface) -> np.ndarray:
    """Normals (F, 3) of the faces, as long as twice their area."""
    a, b, c = np.moveaxis(surface.corners(), 1, 0)
    return np.cross(b - a, c - a)


def _normalised(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 0, vectors / np.where(length > 0, length, 1), (0.0, 0.0, 1.0))
