"""A height map as a surface before a pinhole camera: rays, points and normals.

Problem: SIRFS sees a photo as an orthographic view, in which the viewing ray of every pixel is
along z. A camera has another ray for each pixel, and sees an object off the photo's centre from the
side: by up to 40 degrees where the lens is that of a telephone.

Equation: d(x) = (a, -b, -1) is the ray of a pixel, a and b its offsets from the principal point
over the focal length f; c, the axis, is the unit vector from the camera to the middle of the
object, the mean of its rays. Heights count from the plane that faces the camera there, in a
logarithm, so that no height reaches the camera:

    P(x) = f exp(-h(x) / f) d(x) / (d(x) . c),

which is -h along the axis for small h. With H = h + f log(d . c) the depth is f exp(-H / f), and
the normal is, up to its length, the cross product of the derivatives of P,

    n = (-H_right, H_down, 1 - a H_right - b H_down).

Its product with -d is 1 before normalising: every normal faces its camera, and where the height is
steepest, at the silhouette, it is perpendicular to the ray.

Citation: E. Prados, O. Faugeras, "Perspective shape from shading and viscosity solutions" (2003),
doi:10.1109/ICCV.2003.1238433 (the logarithm of the depth).

Limits: what the solver took for an orthographic view of the object was none, so a sphere does not
become an exact sphere; see docs/methods/camera.md.
"""

import numpy as np

from ..photo.camera import Camera
from .surface_stencils import FIRST_DOWN, FIRST_RIGHT, derivative


def ray_offsets(camera: Camera, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the offsets of pixel centres from the principal point.

    Parameters
    ----------
    camera : Camera
    shape : tuple of int
        Rows and columns.

    Returns
    -------
    right, down : (H, W) ndarray
        In focal lengths.
    """
    x, y = camera.principal_point
    right = (np.arange(shape[1]) + 0.5 - x) / camera.focal_length
    down = (np.arange(shape[0]) + 0.5 - y) / camera.focal_length
    return np.broadcast_to(right, shape), np.broadcast_to(down[:, None], shape)


def view_directions(camera: Camera, shape: tuple[int, int]) -> np.ndarray:
    """Return the directions from the pixels toward the camera.

    Parameters
    ----------
    camera : Camera
    shape : tuple of int
        Rows and columns.

    Returns
    -------
    (H, W, 3) ndarray
        Unit vectors, camera frame.
    """
    right, down = ray_offsets(camera, shape)
    toward = np.stack([-right, down, np.ones(shape)], axis=-1)
    return toward / np.sqrt(1 + right**2 + down**2)[..., None]


def object_axis(camera: Camera, mask: np.ndarray) -> np.ndarray:
    """Return the direction from the camera to the middle of the object.

    Parameters
    ----------
    camera : Camera
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    (3,) ndarray
        Unit vector, camera frame.
    """
    mean = -view_directions(camera, (mask.shape[0], mask.shape[1]))[mask].mean(axis=0)
    return np.asarray(mean / np.sqrt((mean * mean).sum()))


def lifted_points(height: np.ndarray, camera: Camera, axis: np.ndarray) -> np.ndarray:
    """Compute the points of a height map.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.
    camera : Camera
    axis : (3,) ndarray
        Of `object_axis`.

    Returns
    -------
    (H, W, 3) ndarray
        Camera frame, the pinhole at the origin; the unit is a pixel at the focal length's distance.
    """
    right, down = ray_offsets(camera, (height.shape[0], height.shape[1]))
    ray = np.stack([right, -down, -np.ones(height.shape)], axis=-1)
    depth = camera.focal_length * np.exp(-height / camera.focal_length) / _along(right, down, axis)
    return ray * depth[..., None]


def lifted_normals(height: np.ndarray, camera: Camera, axis: np.ndarray) -> np.ndarray:
    """Compute the unit normals of a height map before a camera.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer, continued beyond the object.
    camera : Camera
    axis : (3,) ndarray
        Of `object_axis`.

    Returns
    -------
    (H, W, 3) ndarray
        Camera frame; each faces the camera.
    """
    right, down = ray_offsets(camera, (height.shape[0], height.shape[1]))
    along = _along(right, down, axis)
    padded = np.pad(height.astype(float), 1, mode="edge")
    by_right = derivative(padded, FIRST_RIGHT) + axis[0] / along
    by_down = derivative(padded, FIRST_DOWN) - axis[1] / along
    normal = np.stack([-by_right, by_down, 1 - right * by_right - down * by_down], axis=-1)
    return normal / np.sqrt((normal * normal).sum(axis=-1, keepdims=True))


def rotation_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the smallest rotation from one direction to another.

    Parameters
    ----------
    start, end : (3,) ndarray
        Unit vectors, not opposite.

    Returns
    -------
    (3, 3) ndarray
        `end` = rotation @ `start`.
    """
    x, y, z = np.cross(start, end)
    turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + turn + turn @ turn / (1 + (start * end).sum()))


def far_view_normals(normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return the normals that mirror the same light to a viewer on the z axis, infinitely far.

    Parameters
    ----------
    normal, view : (..., 3) ndarray
        Unit vectors; the views may be one, (3,).

    Returns
    -------
    (..., 3) ndarray
        Unit vectors, z >= 0; (0, 0, 1) where light from behind the object would be mirrored.
    """
    half = 2 * (normal * view).sum(axis=-1, keepdims=True) * normal - view + (0, 0, 1)
    length = np.sqrt((half * half).sum(axis=-1, keepdims=True))
    return np.where(length > 1e-6, half / np.maximum(length, 1e-6), np.array([0.0, 0.0, 1.0]))


def _along(right: np.ndarray, down: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """The part d . c of each ray along the axis."""
    return np.asarray(right * axis[0] - down * axis[1] - axis[2])
