"""The mesh with a smooth outline, fewer triangles and a back, from the maps of a result.

The recovered normals of the visible side are in its vertices, and what lies between these in a
tangent-space normal map. Rim and back have the normals of their faces, and confidence 0.

Equation: before a pinhole camera all vertices lie on the rays of their pixels, so that the front
hides the back.
"""

import numpy as np

from isc_core.result_files.solids.body import Back, Body, continued, make_body
from isc_core.result_files.vertex_normals import interpolated_normals
from isc_core.shading.perspective import view_directions

from ..datablocks.mesh import MeshGeometry, metres_per_pixel, to_blender
from ..files.result_arrays import ResultArrays
from .camera import camera_of


def body_geometry(
    result: ResultArrays, size_metres: float, back: str, triangles: int
) -> tuple[MeshGeometry, np.ndarray]:
    """Return the mesh of a body, and its normal map; this may run in another thread.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.
    back : str
        A value of `Back`.
    triangles : int
        The most of the visible side; 0 for two at each pixel.

    Returns
    -------
    geometry : MeshGeometry
        Triangles with a normal per vertex.
    normal_map : (H, W, 3) ndarray of float32
        Tangent space, [0, 1] for [-1, 1].

    Raises
    ------
    InputError
        If the object is too thin for a mesh, or the size is not positive.
    """
    body, smooth, detail = _solid(result, back, triangles)
    vertices = _placed(result, body) * metres_per_pixel(result, size_metres)
    normals = _face_normals(vertices, body.faces)
    normals[: len(smooth)] = smooth
    rows, columns = body.pixels.T
    height, width = result.mask.shape
    uv = np.stack([(body.texture[:, 1] + 0.5) / width, 1 - (body.texture[:, 0] + 0.5) / height], -1)
    confidence = np.where(body.front, result.confidence[rows, columns], 0.0)
    geometry = MeshGeometry(
        to_blender(vertices),
        np.ascontiguousarray(body.faces.ravel(), np.int32),
        np.arange(0, body.faces.size, 3, dtype=np.int32),
        uv,
        confidence,
        to_blender(normals),
    )
    return geometry, ((detail + 1) / 2).astype(np.float32)


def _solid(result: ResultArrays, back: str, triangles: int) -> tuple[Body, np.ndarray, np.ndarray]:
    """The mesh in pixels, the normals of its visible vertices, and the tangent-space normals."""
    camera, (height, width) = camera_of(result), result.mask.shape
    view = np.array([0.0, 0.0, 1.0])
    if camera is not None:
        view = view_directions(camera, (height, width))
    cosine = (result.normal * view).sum(-1)
    body = make_body(_heights(result), cosine, result.mask, result.mask, Back(back), triangles)
    smooth, detail = interpolated_normals(body.visible, _continued_normals(result, body), view)
    return body, smooth, detail


def _heights(result: ResultArrays) -> np.ndarray:
    """(H, W): pixels toward the viewer from the mesh's origin, inside the mask.

    Where the result's mesh has a vertex its height is taken, whose spikes at the rim are limited.
    """
    rows, columns = result.vertex_pixel.T
    found = np.zeros(result.mask.shape)
    found[rows, columns] = result.vertices[:, 2] / result.metres_per_pixel
    known = np.zeros_like(result.mask)
    known[rows, columns] = True
    if result.eye is None:
        return np.where(known, found, result.height - result.origin[2])
    return continued(found, known, result.mask)


def _placed(result: ResultArrays, body: Body) -> np.ndarray:
    """(V, 3): the vertices in pixels, camera frame, the mesh's origin at 0."""
    row, column = body.places.T
    if result.eye is None or result.focal_length is None or result.principal_point is None:
        return np.stack([column - result.origin[0], result.origin[1] - row, body.heights], -1)
    eye = result.eye.astype(np.float64) / result.metres_per_pixel
    right = (column + 0.5 - result.principal_point[0]) / result.focal_length
    down = (row + 0.5 - result.principal_point[1]) / result.focal_length
    depth = eye[2] - body.heights
    return np.stack([eye[0] + right * depth, eye[1] - down * depth, body.heights], -1)


def _continued_normals(result: ResultArrays, body: Body) -> np.ndarray:
    """(H, W, 3): the unit normals, also of pixels of the body just beyond the mask."""
    inside = result.mask.copy()
    inside[body.pixels[:, 0], body.pixels[:, 1]] = True
    planes = [
        continued(np.where(result.mask, plane, 0), result.mask, inside)
        for plane in np.moveaxis(result.normal, -1, 0)
    ]
    normal = np.stack(planes, -1)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.where(length > 0, normal / np.maximum(length, 1e-9), (0.0, 0.0, 1.0))


def _face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3): means of the faces' unit normals, by area."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    sums = np.stack(
        [np.bincount(faces.ravel(), part.repeat(3), len(vertices)) for part in across.T], -1
    )
    return np.asarray(sums / np.maximum(np.linalg.norm(sums, axis=-1, keepdims=True), 1e-30))
