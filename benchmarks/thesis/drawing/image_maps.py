"""Maps as linear images on white, cropped to the object, with comparable exposures.

Equation: errors of a layer are drawn between two colour-blind-safe colours: orange where light
remains, blue where too much was removed, in full colour from a tenth of the photo's white.

Limits: what a map leaves undetermined (offset of the height, scale of shading, reflectance and
light) is fitted to the ground truth before drawing, as in the errors.
"""

import matplotlib
import numpy as np

from isc_core.imaging.bounding_box import mask_slices
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.shading.sphere import sphere_normals
from isc_core.shading.spherical_harmonics import real_sh

from .style import OKABE_ITO, normal_colours

_FULL = 0.1  # of the photo's white
_PAPER = 1.0
_BALL = 160  # pixels


def crop_image(
    values: np.ndarray, mask: np.ndarray, gain: float = 1.0, frame: np.ndarray | None = None
) -> np.ndarray:
    """Crop an image to its mask, white outside.

    Parameters
    ----------
    values : (H, W, 3) ndarray
        Linear image.
    mask : (H, W) ndarray
        Pixels to show.
    gain : float
        Exposure.
    frame : (H, W) ndarray, optional
        Mask whose bounding box is used instead.

    Returns
    -------
    (h, w, 3) ndarray
        Values in [0, 1].
    """
    box = mask_slices(mask if frame is None else frame)
    return np.where(mask[box][..., None], np.clip(np.nan_to_num(values[box]) * gain, 0, 1), _PAPER)


def mark_pixels(image: np.ndarray, mask: np.ndarray, pixels: np.ndarray, gain: float) -> np.ndarray:
    """Draw a photo in grey with marked pixels in orange.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear photo.
    mask : (H, W) ndarray
        The object.
    pixels : (H, W) ndarray
        Boolean, pixels to mark.
    gain : float
        Exposure.

    Returns
    -------
    (h, w, 3) ndarray
        Cropped linear image.
    """
    grey = np.repeat(0.7 * image.mean(axis=2, keepdims=True) * gain, 3, axis=2)
    return crop_image(np.where((pixels & mask)[..., None], _linear(OKABE_ITO[1]), grey), mask)


def signed_error(error: np.ndarray, mask: np.ndarray, gain: float) -> np.ndarray:
    """Draw the errors of a layer: orange above 0, blue below.

    Parameters
    ----------
    error : (H, W, 3) ndarray
        Errors of a linear layer.
    mask : (H, W) ndarray
        The object.
    gain : float
        Exposure; the photo's white is 1 / gain.

    Returns
    -------
    (h, w, 3) ndarray
        Cropped linear image.
    """
    mean = error.mean(axis=2, keepdims=True) * gain
    weight = np.clip(np.abs(mean) / _FULL, 0, 1)
    colour = np.where(mean > 0, _linear(OKABE_ITO[1]), _linear(OKABE_ITO[0]))
    return crop_image((1 - weight) * 0.85 + weight * colour, mask)


def height_colours(height: np.ndarray, mask: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Draw heights in the colours of viridis, white where unknown.

    Parameters
    ----------
    height : (H, W) ndarray
        Heights, pixels.
    mask : (H, W) ndarray
        The object.
    limits : (float, float)
        Heights at the ends of the colour scale.

    Returns
    -------
    (h, w, 3) ndarray
        Cropped linear image.
    """
    share = np.clip((np.nan_to_num(height) - limits[0]) / max(limits[1] - limits[0], 1e-9), 0, 1)
    colours = np.asarray(matplotlib.colormaps["viridis"](share))[..., :3]
    shown = np.where(np.isfinite(height)[..., None], srgb_to_linear(colours), _PAPER)
    return crop_image(shown, mask)


def normal_image(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Draw normals as (n + 1) / 2, cropped to the mask, white where unknown.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        Unit normals in the camera frame; not finite where unknown.
    mask : (H, W) ndarray of bool
        Pixels of the object.

    Returns
    -------
    (h, w, 3) ndarray
        The bounding box of the mask.
    """
    known = mask & np.isfinite(normal).all(axis=2)
    return np.asarray(normal_colours(np.nan_to_num(normal), known)[mask_slices(mask)])


def light_ball(light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Render a white ball under a light.

    Parameters
    ----------
    light : (9, 3) ndarray
        SH coefficients of log shading.

    Returns
    -------
    image : (160, 160, 3) ndarray
        Linear image.
    mask : (160, 160) ndarray
        Pixels of the ball.
    """
    normal, coverage = sphere_normals(_BALL)
    return np.exp(real_sh(normal) @ light), coverage > 0.5


def pad_to_aspect(picture: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Pad a square picture with white to the proportions of the bounding box of a mask.

    Parameters
    ----------
    picture : (S, S, 3) ndarray
        The picture.
    mask : (H, W) ndarray
        Mask whose box sets the proportions, so that all pictures of a row have one height.

    Returns
    -------
    (h, w, 3) ndarray
        The padded picture.
    """
    rows, columns = (part.stop - part.start for part in mask_slices(mask))
    side = len(picture)
    more = [max(0, round(side * (ratio - 1) / 2)) for ratio in (rows / columns, columns / rows)]
    return np.pad(picture, ((more[0],) * 2, (more[1],) * 2, (0, 0)), constant_values=_PAPER)


def fit_scale(values: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Scale a map to the least squared difference from the ground truth inside a mask.

    Parameters
    ----------
    values, truth : (H, W, 3) ndarray
        The map and the ground truth.
    mask : (H, W) ndarray
        Pixels to compare.

    Returns
    -------
    (H, W, 3) ndarray
        The scaled map.
    """
    ours, theirs = values[mask].astype(float), truth[mask].astype(float)
    return values * ((ours * theirs).sum() / max(float((ours * ours).sum()), 1e-30))


def _linear(colour: str) -> np.ndarray:
    return np.asarray(srgb_to_linear(np.array(matplotlib.colors.to_rgb(colour))))
