"""An estimate of the orthographic solver, brought before the photo's camera.

Problem: the solver's normals are relative to the ray by which a pixel is seen, its light to the
axis toward the object (see `shading.perspective`). A result is in the frame of the camera, and its
shading has to be that of its light on its normals.

Equation: with Y the spherical harmonics, n the normals before the camera and s the solver's log
shading, the light is

    L = argmin over L of mean |Y(n) L - s|^2 + w |L - T L_0|^2,

L_0 the solver's light and T the rotation from z to the axis, w = 1e-5: it matters only for objects
whose normals do not determine nine coefficients. A light of the lobe fit is turned as the mirrored
ray is turned at its highlight.

Citation: R. Ramamoorthi, P. Hanrahan 2001, doi:10.1145/383259.383317.

Limits: a known light is not changed. The lobe itself is fitted to the solver's normals: over one
highlight the rays are nearly parallel.
"""

from dataclasses import replace

import numpy as np

from ..imaging.row_blocks import row_blocks
from ..io.focal_length import pixels_of_35mm
from ..numerics.linear import solve_linear
from ..photo import Photo
from ..photo.camera import Camera, CameraSource
from ..scene.lobe_fit import LobeFit
from ..shading.lights import VIEW, turned_light
from ..shading.perspective import (
    lifted_normals,
    object_axis,
    rotation_between,
    view_directions,
)
from ..shading.spherical_harmonics import light_from_reference, real_sh
from .layers import normals_and_shading
from .settings import CameraChoice, Settings
from .task import SceneEstimate

_LIGHT_WEIGHT = 1e-5
_HIGHLIGHT = 200.0  # sharpness of the weights that find a light's highlight: some 6 degrees


def with_camera(photo: Photo, settings: Settings, known_shape: bool) -> Photo:
    """Return the photo with the camera that the settings choose.

    Parameters
    ----------
    photo : Photo
        With the camera of its file, if known.
    settings : Settings
    known_shape : bool
        Whether a shape or a depth is given: such maps are orthographic, so only a focal length in
        the settings makes a perspective of them.

    Returns
    -------
    Photo
    """
    millimetres = settings.focal_length_35mm
    if millimetres is not None:
        size = (photo.mask.shape[1], photo.mask.shape[0])
        pixels = pixels_of_35mm(millimetres, size)
        return replace(photo, camera=Camera.of_frame(pixels, size, CameraSource.OPTION))
    keeps = settings.camera == CameraChoice.AUTO and not known_shape
    return photo if keeps else replace(photo, camera=None)


def before_camera(
    estimate: SceneEstimate, camera: Camera, mask: np.ndarray, *, known_light: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute normals, shading and light of an estimate before a camera.

    Parameters
    ----------
    estimate : SceneEstimate
    camera : Camera
        Of the maps.
    mask : (H, W) ndarray of bool
        The object.
    known_light : bool, optional
        Whether the light was given, and is kept.

    Returns
    -------
    normal : (H, W, 3) ndarray of float32
        Unit normals, camera frame; (0, 0, 1) outside the mask.
    shading : (H, W, 3) ndarray of float32
        Linear Rec.709; 0 outside the mask.
    light : (9, 3) ndarray
        Coefficients of log shading, camera frame.
    """
    axis = object_axis(camera, mask)
    flat, _ = normals_and_shading(estimate.height, estimate.light, mask)
    normal = lifted_normals(estimate.height, camera, axis).astype(np.float32)
    normal[~mask] = VIEW
    light = light_from_reference(estimate.light)
    if not known_light:
        expected = turned_light(light, rotation_between(VIEW, -axis))
        light = _refitted(normal, flat, light, expected, mask)
    shading = np.zeros((*mask.shape, 3), np.float32)
    for block in row_blocks(mask.shape):
        inside = mask[block.rows]
        basis = real_sh(normal[block.rows][inside].astype(float))
        shading[block.rows][inside] = np.exp(np.einsum("nk,kc->nc", basis, light))
    return normal, shading, light


def _refitted(
    normal: np.ndarray, flat: np.ndarray, light: np.ndarray, expected: np.ndarray, mask: np.ndarray
) -> np.ndarray:
    """The light (9, 3), `expected` or so, whose log shading of the normals is nearest to that of
    the normals without a camera, `flat`, under `light`; sums are those of blocks of rows.
    """
    gram, right, count = np.zeros((9, 9)), np.zeros((9, 3)), np.count_nonzero(mask)
    for block in row_blocks(mask.shape):
        inside = mask[block.rows]
        basis, before = (real_sh(part[block.rows][inside].astype(float)) for part in (normal, flat))
        gram += np.einsum("nk,nl->kl", basis, basis)
        right += np.einsum("nk,nc->kc", basis, np.einsum("nk,kc->nc", before, light))
    return solve_linear(
        gram / count + _LIGHT_WEIGHT * np.eye(9), right / count + _LIGHT_WEIGHT * expected
    )


def lobe_before_camera(
    estimate: SceneEstimate, camera: Camera, normal: np.ndarray, mask: np.ndarray
) -> LobeFit | None:
    """Turn the lights of a lobe fit into the frame of the camera.

    Parameters
    ----------
    estimate : SceneEstimate
        With the fit to the solver's normals.
    camera : Camera
        Of the maps.
    normal : (H, W, 3) ndarray
        Unit normals before the camera.
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    LobeFit or None
        None without a fit.
    """
    fit = estimate.brdf
    if fit is None or not fit.lights:
        return fit
    flat = normals_and_shading(estimate.height, estimate.light, mask)[0][mask].astype(float)
    view = view_directions(camera, (mask.shape[0], mask.shape[1]))[mask]
    before, after = _mirrored(flat, VIEW), _mirrored(normal[mask].astype(float), view)
    lights = []
    for light in fit.lights:
        half = light.direction + VIEW
        near = (flat * (half / max(float(np.linalg.norm(half)), 1e-9))).sum(axis=1)
        weight = np.exp(_HIGHLIGHT * (near - near.max()))
        turn = rotation_between(_mean(before, weight), _mean(after, weight))
        lights.append(replace(light, direction=(turn * light.direction).sum(axis=1)))
    return replace(fit, lights=tuple(lights))


def _mirrored(normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """The directions (N, 3) that normals mirror to a view."""
    return np.asarray(2 * (normal * view).sum(axis=1, keepdims=True) * normal - view)


def _mean(directions: np.ndarray, weight: np.ndarray) -> np.ndarray:
    mean = (weight[:, None] * directions).sum(axis=0)
    return np.asarray(mean / np.sqrt((mean * mean).sum()))
