"""The result of every baseline, and its computation from a shading image."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..shading.surface_stencils import normals
from .light_direction import estimate_light
from .light_fit import fit_light

Solver = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class BaselineEstimate:
    """A shape and a light, from which the pipeline derives normals, shading and reflectance so
    that its identities hold.

    Attributes
    ----------
    height : (H, W) float64 ndarray
        Pixels toward the viewer, mean 0 in the mask. It is extrapolated beyond the mask, so that
        normals at the rim are meaningful.
    log_shading : (H, W, 3) float64 ndarray
        The method's own shading, 0 outside the mask.
    light : (9, 3) float64 ndarray
        Log-shading SH coefficients, reference convention, fitted to the log shading with the
        normals of the height.
    """

    height: np.ndarray
    log_shading: np.ndarray
    light: np.ndarray


def from_log_shading(log_shading: np.ndarray, mask: np.ndarray, solve: Solver) -> BaselineEstimate:
    """Estimate the shape from a shading image, and fit the light.

    Parameters
    ----------
    log_shading : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    solve : Solver
        ``solve(brightness, mask, light vector) -> height``.

    Returns
    -------
    BaselineEstimate
    """
    brightness = np.where(mask, np.exp(log_shading.mean(axis=2)), 0)
    height = solve(brightness, mask, estimate_light(brightness, mask))
    return BaselineEstimate(height, log_shading, fit_light(log_shading, normals(height), mask))


def grey_log_shading(log_image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the log shading of an object of one albedo: the log of the channels' mean.

    Parameters
    ----------
    log_image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W, 3) ndarray
        Median 0 in the mask.

    Raises
    ------
    InputError
        As `check_log_image`.
    """
    check_log_image(log_image, mask)
    grey = np.zeros(mask.shape)
    grey[mask] = np.log(np.exp(log_image[mask].astype(float)).mean(axis=1))
    grey[mask] -= np.median(grey[mask])
    return np.repeat(grey[..., None], 3, axis=2)


def check_log_image(log_image: np.ndarray, mask: np.ndarray) -> None:
    """Check the inputs of a baseline.

    Parameters
    ----------
    log_image : (H, W, 3) ndarray
        Finite in the mask.
    mask : (H, W) bool ndarray
        Not empty.

    Raises
    ------
    InputError
        If the shape or the values of one of them are invalid.
    """
    if log_image.ndim != 3 or log_image.shape[2] != 3:
        raise InputError(
            f"a baseline needs a colour image of shape (H, W, 3), not {log_image.shape}:"
            " convert it to RGB"
        )
    if mask.shape != log_image.shape[:2] or mask.dtype != bool:
        raise InputError(
            f"the mask must be boolean and {log_image.shape[:2]} like the image,"
            f" not {mask.dtype} {mask.shape}"
        )
    if not mask.any():
        raise InputError("the mask is empty: mark at least the object's pixels")
    if not np.isfinite(log_image[mask]).all():
        raise InputError(
            "the log image is not finite inside the mask: floor its zeros or mask those pixels out"
        )
