"""The mesh with a smooth outline, fewer triangles and a back, from the maps of a result.

The confidence is 0 on the rim and on the back.
"""

import numpy as np

from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.mesh.rim_heights import limit_rim
from isc_core.result_files.solids.back import Back
from isc_core.result_files.solids.rim import Rim
from isc_core.result_files.solids.surface import (
    Solid,
    before_camera,
    make_solid,
    view_heights,
)
from isc_core.shading.perspective import view_directions

from ..datablocks.mesh import MeshGeometry, metres_per_pixel, to_blender
from ..datablocks.quads import joined_quads
from ..files.result_arrays import ResultArrays


def solid_geometry(
    result: ResultArrays, size_metres: float, back: str, triangles: int
) -> tuple[MeshGeometry, np.ndarray]:
    """Return the solid mesh of an object and its normal map; may run in another thread.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.
    back : str
        A value of `Back`.
    triangles : int
        Maximum number on the visible side; 0 for two per pixel.

    Returns
    -------
    geometry : MeshGeometry
        Quads, and triangles where sizes change and along the outline; one normal per vertex.
    normal_map : (H, W, 3) ndarray of float32
        Tangent space, [0, 1] for [-1, 1].

    Raises
    ------
    InputError
        If the object is too thin for a mesh, or the size is not positive.
    """
    solid = _solid(result, back, triangles)
    mesh = solid.mesh
    vertices = _placed(result, solid) * metres_per_pixel(result, size_metres)
    rows, columns = mesh.pixels.T
    confidence = np.where(mesh.front, result.confidence[rows, columns], 0.0)
    geometry = MeshGeometry(
        to_blender(vertices),
        *joined_quads(mesh.faces, mesh.places),
        solid.uv(),
        confidence,
        to_blender(solid.normals(vertices)),
    )
    return geometry, ((solid.detail + 1) / 2).astype(np.float32)


def _solid(result: ResultArrays, back: str, triangles: int) -> Solid:
    """The mesh in pixels."""
    camera, (height, width) = result.camera, result.mask.shape
    view = np.array([0.0, 0.0, 1.0])
    if camera is not None:
        view = view_directions(camera, (height, width))
    rim = Rim(result.mask if result.cover is None else result.cover, result.soft)
    heights, normal, mask = _heights(result), result.normal, result.mask
    return make_solid(heights, normal, mask, rim, view, Back(back), triangles)


def _heights(result: ResultArrays) -> np.ndarray:
    """(H, W): pixels toward the viewer from the mesh's origin, inside the mask.

    At a vertex of the result's mesh this is its height. That mesh may have fewer vertices than
    pixels: the others are lifted alike.
    """
    limited = limit_rim(result.height, result.mask, MeshOptions().rim)
    if result.eye is None:
        return limited - result.origin[2]
    seen = view_heights(limited, result.mask, result.camera)
    # The unit of the result's mesh is a pixel at the mean distance of its own vertices.
    rows, columns = result.vertex_pixel.T
    eye, vertices = (
        axis[..., 2] / result.metres_per_pixel for axis in (result.eye, result.vertices)
    )
    scale = (eye - vertices.mean()) / -seen[rows, columns].mean()
    return np.asarray(eye + scale * seen)


def _placed(result: ResultArrays, solid: Solid) -> np.ndarray:
    """(V, 3): the vertices in pixels, camera frame, the mesh's origin at 0."""
    (row, column), heights, camera = solid.mesh.places.T, solid.mesh.heights, result.camera
    if result.eye is None or camera is None:
        return np.stack([column - result.origin[0], result.origin[1] - row, heights], -1)
    eye = result.eye.astype(np.float64) / result.metres_per_pixel
    return eye + before_camera(solid.mesh.places, eye[2] - heights, camera)
