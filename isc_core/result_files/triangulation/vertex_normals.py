"""Normals of a mesh's vertices, and the tangent-space normal map of the remaining detail.

Problem: a mesh has fewer vertices than there are pixels. The interpolated normals of its triangles
are smooth; a normal map stores the detail.

Equation: a vertex has the mean normal of the pixels of its triangles, weighted by its barycentric
coordinates. With this normal n interpolated to a pixel, t the unit tangent along increasing texture
columns, and b = n x t, the map has the pixel's normal in the frame (t, b, n).

Citation: J. Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978, doi:10.1145/800248.507101.

Limits: normals that face away from the viewer are rotated until their tangent is defined.
"""

import numpy as np

from ...imaging.channels import length, total
from ...imaging.row_blocks import CACHED, row_blocks
from .adaptive_triangles import Triangulation, covered_pixels

_LEAST_FACING = 1e-3  # cosine of a vertex normal to its view, so that its tangent is defined


def interpolated_normals(
    grid: Triangulation, normal: np.ndarray, view: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normals of vertices, and the tangent-space map of the detail.

    Parameters
    ----------
    grid : Triangulation
        Over the pixels; a vertex without a triangle has the normal of its pixel.
    normal : (H, W, 3) ndarray
        Unit vectors, camera frame.
    view : (3,) or (H, W, 3) ndarray
        Unit vectors toward the viewer.

    Returns
    -------
    smooth : (V, 3) ndarray
        Unit vectors.
    detail : (H, W, 3) ndarray
        Unit vectors in tangent space.
    """
    smooth = mean_normals(grid, 1, normal, view)
    alone = np.ones(len(smooth), bool)
    alone[grid.faces] = False
    row, column = grid.vertices[alone].T
    smooth[alone] = facing(normal[row, column].astype(np.float32), directions_at(view, row, column))
    return smooth, detail_normals(grid, 1, normal, smooth, view)[0]


def mean_normals(
    grid: Triangulation, stride: int, normal: np.ndarray, view: np.ndarray
) -> np.ndarray:
    """Return the normals of vertices: weighted means over the pixels of their triangles.

    Parameters
    ----------
    grid : Triangulation
    stride : int
        Pixels per step of the grid.
    normal : (H, W, 3) ndarray
        Unit vectors, camera frame.
    view : (3,) or (H, W, 3) ndarray
        Unit vectors toward the viewer.

    Returns
    -------
    (V, 3) float32 ndarray
        Unit vectors.
    """
    sums = np.zeros((len(grid.vertices), 3))
    seen = np.ascontiguousarray(normal).reshape(-1, 3)
    for patch in covered_pixels(grid, stride):
        there = seen.take(patch.flat_pixels(normal.shape[1]), axis=0)
        part = patch.weights.T.astype(seen.dtype) @ there.reshape(len(there), -1)
        corners = patch.faces.T.ravel()
        for axis in range(3):
            sums[:, axis] += np.bincount(corners, part[:, axis::3].ravel(), len(sums))
    return facing(sums.astype(np.float32), directions_at(view, *(grid.vertices * stride).T))


def detail_normals(
    grid: Triangulation,
    stride: int,
    normal: np.ndarray,
    smooth: np.ndarray,
    view: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the tangent-space map, each pixel's normal relative to the interpolated one.

    Parameters
    ----------
    grid, stride, normal, view
        As for `mean_normals`.
    smooth : (V, 3) ndarray
        Normals of the vertices.

    Returns
    -------
    detail : (H, W, 3) ndarray
        Unit vectors in tangent space.
    tangents : (V, 3) ndarray
        Of the vertices.
    """
    detail = np.full((*normal.shape[:2], 3), np.nan, np.float32)
    flat = detail.reshape(-1, 3)
    for patch in covered_pixels(grid, stride):
        corners = smooth.take(patch.faces.T, axis=0).reshape(3, -1)
        base = patch.weights.astype(np.float32) @ corners
        flat[patch.flat_pixels(normal.shape[1])] = base.reshape(len(base), -1, 3)
    # each pixel once: triangles share those on their sides
    for block in row_blocks(detail.shape, pixels=CACHED):
        rows = detail[block.rows]
        covered = ~np.isnan(rows[..., 0])
        toward = view if view.ndim == 1 else view[block.rows][covered]
        rows[covered] = _local(normal[block.rows][covered], facing(rows[covered], toward), toward)
        rows[~covered] = flat_normals(())
    return detail, _tangents(smooth, directions_at(view, *(grid.vertices * stride).T))


def view_cosine(normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return the cosine of the angle between normal and view.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        Unit vectors, camera frame.
    view : (3,) or (H, W, 3) ndarray
        Unit vectors toward the viewer.

    Returns
    -------
    (H, W) float32 ndarray
    """
    cosine = np.empty(normal.shape[:2], np.float32)
    for block in row_blocks(cosine.shape, pixels=CACHED):
        toward = view if view.ndim == 1 else view[block.rows]
        cosine[block.rows] = total(normal[block.rows] * toward)
    return cosine


def directions_at(view: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Return the view directions of pixels, or the common one.

    Parameters
    ----------
    view : (3,) or (H, W, 3) ndarray
    row, column : (...) ndarray of int

    Returns
    -------
    (3,) or (..., 3) ndarray
    """
    return view if view.ndim == 1 else view[row, column]


def flat_normals(shape: tuple[int, ...]) -> np.ndarray:
    """Return the tangent-space map of a surface without detail.

    Parameters
    ----------
    shape : tuple of int
        (H, W).

    Returns
    -------
    (H, W, 3) float32 ndarray
        Read only.
    """
    return np.broadcast_to(np.array([0, 0, 1], np.float32), (*shape, 3))


def _tangents(normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """The unit tangent (..., 3) along increasing texture columns."""
    if view.ndim == 1:
        tangent = np.stack([normal[..., 2], np.zeros_like(normal[..., 0]), -normal[..., 0]], -1)
    else:  # on the surface, and in the plane of the pixel's row through the camera
        tangent = np.cross(normal, np.cross((1.0, 0.0, 0.0), view)).astype(normal.dtype)
    return np.asarray(tangent / length(tangent)[..., None])


def _local(normal: np.ndarray, base: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Normals (..., 3) in the frame of tangent, bitangent (along falling texture rows) and base."""
    tangent = _tangents(base, view)
    frame = tangent, np.cross(base, tangent), base
    return np.stack([np.einsum("...c,...c->...", normal, axis) for axis in frame], -1)


def facing(vectors: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return unit vectors that face the viewer; the view itself for zero vectors.

    Parameters
    ----------
    vectors : (..., 3) ndarray
    view : (3,) or (..., 3) ndarray
        (0, 0, 1), or the view direction of each.

    Returns
    -------
    (..., 3) ndarray
    """
    vectors, view = vectors.copy(), view.astype(vectors.dtype)
    size = length(vectors)[..., None]
    vectors = np.where(size > 0, vectors / np.where(size > 0, size, 1), view)
    if view.ndim == 1:
        vectors[..., 2] = np.maximum(vectors[..., 2], _LEAST_FACING)
    else:
        cosine = (vectors * view).sum(axis=-1, keepdims=True)
        vectors += np.maximum(_LEAST_FACING - cosine, 0) * view
    return vectors / length(vectors)[..., None]
