"""Steps that several models share: separating a photo, and shading a recovered shape."""

from dataclasses import replace
from typing import Any

import numpy as np

from ..photo import Photo
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..separation import BEST, COLOUR_ALONE, separate
from ..shading.spherical_harmonics import (
    light_from_reference,
    light_to_reference,
    normal_from_reference,
    real_sh,
)
from ..shading.surface_stencils import normals
from .task import DecompositionTask

_Dtype = type[np.floating[Any]]
_ROWS = 128  # at a time: intermediate doubles take ten times the room of the result


def separated(
    photo: Photo,
    method: str,
    monitor: Monitor | None = None,
    dtype: _Dtype = np.float32,
    *,
    by_colour: bool = False,
) -> Separation:
    """Separate a photo into its layers.

    Parameters
    ----------
    photo : Photo
        The photo.
    method : str
        One of `separation.METHODS`.
    monitor : Monitor, optional
        Receives progress.
    dtype : type, optional
        Precision of the diffuse layer. In float64 it is the image less the specular layer, so that
        it equals an image of that precision where nothing was separated.
    by_colour : bool, optional
        Whether the method `separation.BEST` decides by colour alone.

    Returns
    -------
    Separation
        Layers that sum to the image.

    Raises
    ------
    InputError
        If the method cannot separate this photo.
    Cancelled
        If the monitor cancels.
    """
    changes = COLOUR_ALONE if by_colour and method == BEST else None
    split = separate(
        method, photo.image, photo.mask, photo.clipped, changes=changes, monitor=monitor
    )
    if dtype == np.float32:
        return split
    diffuse = np.maximum(photo.image.astype(dtype) - split.specular - split.residual, 0)
    return replace(split, diffuse=diffuse)


def separated_at_both_scales(task: DecompositionTask) -> tuple[Separation, Separation]:
    """Separate the photo at both scales by the separator of the settings.

    Parameters
    ----------
    task : DecompositionTask
        The photo and the settings.

    Returns
    -------
    maps, working : Separation
        Layers at the scale of the maps and at the working scale.

    Raises
    ------
    InputError
        If the method cannot separate this photo.
    Cancelled
        If the monitor cancels.
    """
    method, monitor, dtype = task.settings.separator, task.monitor, task.options.layer_dtype
    by_colour = task.settings.separates_by_colour
    monitor.report(f"separating ({method})", 0.03)
    with task.clock.stage("separation"):
        split = (
            separated(task.maps, method, monitor.part(0.03, 0.06), dtype, by_colour=by_colour)
            if task.split is None
            else task.split
        )
        return split, split if task.one_scale else separated(
            task.working, method, monitor.part(0.06, 0.08), dtype, by_colour=by_colour
        )


def unseparated(task: DecompositionTask) -> tuple[Separation, np.ndarray]:
    """Take all light as diffuse.

    Parameters
    ----------
    task : DecompositionTask
        The photo.

    Returns
    -------
    split : Separation
        Layers of the maps' photo; the specular layer is 0.
    diffuse : (h, w, 3) ndarray
        Diffuse image of the working photo.
    """
    task.monitor.report("preparing", 0.03)
    dtype = task.options.layer_dtype
    with task.clock.stage("separation"):
        split = separated(task.maps, "none", dtype=dtype)
        return split, split.diffuse if task.one_scale else separated(
            task.working, "none", dtype=dtype
        ).diffuse


def scale_confidence(split: Separation, share: float = 0.5) -> Separation:
    """Return the same layers with their confidence multiplied by `share`.

    Parameters
    ----------
    split : Separation
        The layers.
    share : float, optional
        Factor in [0, 1].

    Returns
    -------
    Separation
        The layers with the lower confidence.
    """
    return replace(split, confidence=np.float32(share) * split.confidence)


def normals_and_shading(
    height: np.ndarray, light: np.ndarray, mask: np.ndarray, dtype: _Dtype = np.float32
) -> tuple[np.ndarray, np.ndarray]:
    """Compute normals and shading of a height under a light: shading = exp(SH(normal)).

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.
    light : (9, 3) ndarray
        Log-shading SH coefficients, reference convention.
    mask : (H, W) ndarray of bool
        The object.
    dtype : type, optional
        Precision of the result.

    Returns
    -------
    normal : (H, W, 3) ndarray
        Unit normals, camera frame; (0, 0, 1) outside the mask.
    shading : (H, W, 3) ndarray
        Linear Rec.709; 0 outside the mask.
    """
    normal, shading = np.empty((*mask.shape, 3), dtype), np.zeros((*mask.shape, 3), dtype)
    ours = light_from_reference(light)
    for first in range(0, len(mask), _ROWS):
        rows = slice(first, first + _ROWS)
        part, inside = normal[rows], mask[rows]
        part[...] = normal_from_reference(_normals_of_rows(height, first))
        part[~inside] = (0, 0, 1)
        log_shading = np.einsum("nk,kc->nc", real_sh(part[inside].astype(float)), ours)
        shading[rows][inside] = np.exp(log_shading)
    return normal, shading


def _normals_of_rows(height: np.ndarray, first: int) -> np.ndarray:
    """The normals of `_ROWS` rows, from these and their neighbours."""
    low, last = max(first - 1, 0), min(first + _ROWS, len(height))
    return normals(height[low : last + 1])[first - low : last - low]


def scaled_light(light: np.ndarray, log_factor: np.ndarray | float) -> np.ndarray:
    """Multiply the shading of a light by a constant factor.

    Parameters
    ----------
    light : (9, C) ndarray
        Log-shading SH coefficients, reference convention.
    log_factor : (3,) ndarray or float
        Logarithm of the factor of each channel. A light of one channel takes the mean.

    Returns
    -------
    (9, C) ndarray
        The scaled light.
    """
    ours, gain = light_from_reference(light), np.broadcast_to(log_factor, 3)
    ours[0] += np.sqrt(4 * np.pi) * (gain if ours.shape[1] == 3 else gain.mean())
    return light_to_reference(ours)
