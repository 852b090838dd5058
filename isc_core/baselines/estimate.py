"""What every baseline hands on, and the way from a shading image to it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..shading.surface_stencils import normals
from .light_direction import estimate_light
from .light_fit import fit_light

Solver = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class BaselineEstimate:
    """A shape and a light, from which the pipeline makes normals, shading and reflectance so that
    its identities hold.

    `height` (H, W) float64, pixels toward the viewer, mean 0 in the mask. It goes on beyond the
    mask, so that normals at the rim mean something. `log_shading` (H, W, 3) float64, the method's
    own shading, 0 outside the mask. `light` (9, 3) float64, reference convention, fitted to the log
    shading with the normals of the height.
    """

    height: np.ndarray
    log_shading: np.ndarray
    light: np.ndarray


def from_log_shading(log_shading: np.ndarray, mask: np.ndarray, solve: Solver) -> BaselineEstimate:
    """Shape from a shading image by `solve(brightness, mask, light vector) -> height`, and the
    light that goes with it.
    """
    brightness = np.where(mask, np.exp(log_shading.mean(axis=2)), 0)
    height = solve(brightness, mask, estimate_light(brightness, mask))
    return BaselineEstimate(height, log_shading, fit_light(log_shading, normals(height), mask))


def grey_log_shading(log_image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The log shading (H, W, 3) of an evenly coloured object: the log of the channels' mean, with
    median 0 in the mask.
    """
    check_log_image(log_image, mask)
    grey = np.zeros(mask.shape)
    grey[mask] = np.log(np.exp(log_image[mask].astype(float)).mean(axis=1))
    grey[mask] -= np.median(grey[mask])
    return np.repeat(grey[..., None], 3, axis=2)


def check_log_image(log_image: np.ndarray, mask: np.ndarray) -> None:
    """Raises `InputError` unless `log_image` is (H, W, 3) and finite in a non-empty `mask` (H, W)
    bool.
    """
    if log_image.ndim != 3 or log_image.shape[2] != 3:
        raise InputError(
            f"a baseline needs a colour image of shape (H, W, 3), not {log_image.shape}: convert it to RGB"
        )
    if mask.shape != log_image.shape[:2] or mask.dtype != bool:
        raise InputError(
            f"the mask must be boolean and {log_image.shape[:2]} like the image, not {mask.dtype} {mask.shape}"
        )
    if not mask.any():
        raise InputError("the mask is empty: mark at least the object's pixels")
    if not np.isfinite(log_image[mask]).all():
        raise InputError(
            "the log image is not finite inside the mask: floor its zeros or mask those pixels out"
        )
