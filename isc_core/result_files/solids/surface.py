"""A solid mesh with the normals of its visible side.

The recovered normals of the visible side are stored at its vertices, and their detail in a
tangent-space normal map. Rim and back have the normals of their faces.

Equation: with a pinhole camera a vertex lies on the ray of its pixel, so that the front occludes
the back.
"""

from dataclasses import dataclass

import numpy as np

from ...imaging.channels import length
from ...photo.camera import Camera
from ...shading.perspective import lifted_points, object_axis
from ..triangulation.vertex_normals import interpolated_normals, view_cosine
from .back import Back
from .rim import Rim
from .solid_mesh import SolidMesh, continued, make_solid_mesh


@dataclass(frozen=True, eq=False)
class Solid:
    """A mesh and its normals.

    Attributes
    ----------
    mesh : SolidMesh
    smooth : (N, 3) ndarray
        Unit normals of the first N vertices, those of the visible side.
    detail : (H, W, 3) ndarray
        Unit vectors of the normal map in tangent space.
    """

    mesh: SolidMesh
    smooth: np.ndarray
    detail: np.ndarray

    def normals(self, vertices: np.ndarray) -> np.ndarray:
        """Return the normals of all vertices.

        Parameters
        ----------
        vertices : (V, 3) ndarray
            Their positions.

        Returns
        -------
        (V, 3) ndarray
            Unit vectors; those of rim and back are area-weighted means over faces.
        """
        normals = vertex_normals(vertices, self.mesh.faces)
        normals[: len(self.smooth)] = self.smooth
        return normals

    def uv(self) -> np.ndarray:
        """Return texture coordinates, v from the bottom of the texture.

        Returns
        -------
        (V, 2) ndarray
        """
        height, width = self.detail.shape[:2]
        row, column = self.mesh.texture.T
        return np.stack([(column + 0.5) / width, 1 - (row + 0.5) / height], -1)


def make_solid(
    height: np.ndarray,
    normal: np.ndarray,
    mask: np.ndarray,
    rim: Rim,
    view: np.ndarray,
    back: Back,
    triangles: int,
) -> Solid:
    """Build the solid of a height map.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer, inside the mask.
    normal : (H, W, 3) ndarray
        Unit vectors, camera frame.
    mask : (H, W) bool ndarray
    rim : Rim
    view : (3,) or (H, W, 3) ndarray
        Unit vectors toward the viewer.
    back : Back
    triangles : int
        Largest number on the visible side; 0 for two at each pixel.

    Returns
    -------
    Solid

    Raises
    ------
    InputError
        If no block of 2 x 2 pixels lies inside.
    """
    mesh = make_solid_mesh(height, view_cosine(normal, view), mask, rim, back, triangles)
    smooth, detail = interpolated_normals(
        mesh.visible, _continued_normals(normal, mask, mesh.pixels), view
    )
    return Solid(mesh, smooth, detail)


def view_heights(height: np.ndarray, mask: np.ndarray, camera: Camera | None) -> np.ndarray:
    """Return heights in the form that `make_solid` expects.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.
    mask : (H, W) bool ndarray
    camera : Camera or None
        None for an orthographic view.

    Returns
    -------
    (H, W) ndarray
        Unchanged without a camera; else minus the depth, whose mean is the focal length.
    """
    if camera is None:
        return height
    depth = -lifted_points(height, camera, object_axis(camera, mask))[..., 2]
    return np.asarray(depth * (-camera.focal_length / depth[mask].mean()))


def vertex_positions(mesh: SolidMesh, camera: Camera | None) -> np.ndarray:
    """Return the vertices of a mesh that was made from `view_heights`.

    Parameters
    ----------
    mesh : SolidMesh
    camera : Camera or None

    Returns
    -------
    (V, 3) ndarray
        Pixels, camera frame.
    """
    if camera is not None:
        return before_camera(mesh.places, -mesh.heights, camera)
    row, column = mesh.places.T
    return np.stack([column, -row, mesh.heights], -1)


def before_camera(places: np.ndarray, depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Return points on the rays of pixels.

    Parameters
    ----------
    places : (V, 2) ndarray
        Row and column.
    depth : (V,) ndarray
        From the pinhole, along the optical axis.
    camera : Camera

    Returns
    -------
    (V, 3) ndarray
        Camera frame, the pinhole at the origin; in the unit of `depth`.
    """
    row, column = places.T
    right = (column + 0.5 - camera.principal_point[0]) / camera.focal_length
    down = (row + 0.5 - camera.principal_point[1]) / camera.focal_length
    return np.stack([right * depth, -down * depth, -depth], -1)


def _continued_normals(normal: np.ndarray, mask: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(H, W, 3): the unit normals, extended to pixels of the mesh just beyond the mask."""
    inside = mask.copy()
    inside[pixels[:, 0], pixels[:, 1]] = True
    found = continued(np.where(mask[..., None], normal, 0), mask, inside)
    x, y, z = np.moveaxis(found, -1, 0)
    known = (x != 0) | (y != 0) | (z != 0)
    np.copyto(z, 1.0, where=~known)
    row, column = np.nonzero(known & ~mask)
    beyond = found[row, column]
    found[row, column] = beyond / length(beyond)[:, None]
    return found


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return unit normals of vertices, the area-weighted means of their faces' normals.

    Parameters
    ----------
    vertices : (V, 3) ndarray
    faces : (F, 3) ndarray of int
        Counter-clockwise from outside.

    Returns
    -------
    (V, 3) ndarray
        0 without a face.
    """
    a, b, c = vertices[faces].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    sums = np.stack(
        [np.bincount(faces.ravel(), part.repeat(3), len(vertices)) for part in across.T], -1
    )
    return np.asarray(sums / np.maximum(length(sums)[:, None], 1e-30))
