"""A closed mesh from the open front that a photo shows: a flat back, and a wall along the outline
and around holes.

Every edge then has two faces that traverse it in opposite directions, as 3D printing and boolean
operations require. Where two parts of the front meet in a single vertex, that vertex is split,
since four faces of the wall would share an edge.

Limits: the back is invented. Its confidence is 0, its texture that of the front.
"""

from dataclasses import replace

import numpy as np

from blender_addon.datablocks.mesh import MeshGeometry


def close_back(
    sheet: MeshGeometry, thickness: float, eye: np.ndarray | None = None
) -> MeshGeometry:
    """Add a wall and a flat back to an open mesh.

    Parameters
    ----------
    sheet : MeshGeometry
        Triangles with a normal per vertex, or none.
    thickness : float
        Metres from the furthest vertex of the sheet to the back, above 0.
    eye : (3,) ndarray, optional
        Place of a pinhole camera: the wall then runs along its rays, so that the front hides it.

    Returns
    -------
    MeshGeometry
        A closed mesh.
    """
    front = _split_pinches(sheet)
    faces, n = front.corners.reshape(-1, 3), len(front.vertices)
    rim = _outline(faces)
    wall = np.stack([rim[:, 1], rim[:, 0], rim[:, 0] + n, rim[:, 1] + n], -1)
    behind = front.vertices.copy()
    depth = behind[:, 1].max() + thickness
    if eye is None:
        behind[:, 1] = depth
    else:
        ray = behind - eye
        behind = eye + ray * ((depth - eye[1]) / ray[:, 1:2])
    vertices = np.concatenate([front.vertices, behind])
    corners = np.concatenate([faces.ravel(), (faces[:, ::-1] + n).ravel(), wall.ravel()]).astype(
        np.int32
    )
    starts = np.concatenate(
        [np.arange(0, 2 * faces.size, 3), 2 * faces.size + np.arange(0, wall.size, 4)]
    ).astype(np.int32)
    confidence = np.concatenate([front.confidence, np.zeros_like(front.confidence)])
    normals = (
        None if front.normals is None else _corner_normals(front.normals, faces, vertices, wall)
    )
    uv = np.concatenate([front.uv, front.uv])
    return MeshGeometry(vertices, corners, starts, uv, confidence, normals)


def _outline(faces: np.ndarray) -> np.ndarray:
    """The edges (E, 2) of a single face, in its direction."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    n = int(faces.max()) + 1
    code, back = edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0]
    return edges[~np.isin(code, back)]


def _corner_normals(
    front: np.ndarray, faces: np.ndarray, vertices: np.ndarray, wall: np.ndarray
) -> np.ndarray:
    """(L, 3): normals of the sheet, of the back, and of the wall, smooth along the outline."""
    across = np.cross(
        vertices[wall[:, 1]] - vertices[wall[:, 0]], vertices[wall[:, 3]] - vertices[wall[:, 0]]
    )
    n = len(front)
    smooth = _unit(
        np.stack(
            [np.bincount((wall % n).ravel(), np.repeat(part, 4), n) for part in _unit(across).T], -1
        )
    )
    back = np.broadcast_to([0.0, 1.0, 0.0], (faces.size, 3))
    return np.concatenate([front[faces.ravel()], back, smooth[(wall % n).ravel()]])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)


def _split_pinches(sheet: MeshGeometry) -> MeshGeometry:
    """The sheet with a separate vertex for each fan of faces that met in one."""
    faces = sheet.corners.reshape(-1, 3).copy()
    leaving = np.bincount(_outline(faces)[:, 0], minlength=len(sheet.vertices))
    copies: list[int] = []
    for vertex in np.flatnonzero(leaving > 1):
        around = np.flatnonzero((faces == vertex).any(1))
        for fan in _fans(faces[around], int(vertex))[1:]:
            chosen = around[fan]
            faces[chosen] = np.where(
                faces[chosen] == vertex, len(sheet.vertices) + len(copies), faces[chosen]
            )
            copies.append(int(vertex))
    take = np.concatenate([np.arange(len(sheet.vertices)), np.array(copies, int)])
    normals = None if sheet.normals is None else sheet.normals[take]
    return replace(
        sheet,
        vertices=sheet.vertices[take],
        corners=faces.ravel(),
        uv=sheet.uv[take],
        confidence=sheet.confidence[take],
        normals=normals,
    )


def _fans(faces: np.ndarray, vertex: int) -> list[list[int]]:
    """Groups of the faces (N, 3) around the vertex that are connected by edges."""
    fans: list[tuple[set[int], list[int]]] = []
    for index, face in enumerate(faces):
        others = set(map(int, face)) - {vertex}
        joined = [fan for fan in fans if fan[0] & others]
        merged = (
            others.union(*(fan[0] for fan in joined)),
            [index, *(k for fan in joined for k in fan[1])],
        )
        fans = [fan for fan in fans if not any(fan is other for other in joined)] + [merged]
    return [sorted(members) for _, members in fans]
