"""Maps as pictures of linear light on white paper, cut to the object, all at exposures that can be
compared.

Equation: errors of a layer are drawn between two colours that colour-blind people tell apart:
orange where light was left over, blue where paint was taken for light, in full colour from a tenth
of the photo's white on.

Limits: what a map cannot tell (the offset of heights, the scale of shading, reflectance and light)
is fitted to the truth before it is drawn, as the errors do.
"""

import matplotlib
import numpy as np

from isc_core.editing.spheres import sphere_normals
from isc_core.imaging.bounding_box import mask_slices
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.shading.spherical_harmonics import real_sh

from .style import OKABE_ITO, normal_colours

_FULL = 0.1  # of the photo's white
_PAPER = 1.0
_BALL = 160  # pixels


def crop_image(
    values: np.ndarray, mask: np.ndarray, gain: float = 1.0, frame: np.ndarray | None = None
) -> np.ndarray:
    """An image (H, W, 3) inside `mask` (H, W), white outside; cut to the box of `frame` (H, W)
    bool, the mask's own without it.
    """
    box = mask_slices(mask if frame is None else frame)
    return np.where(mask[box][..., None], np.clip(np.nan_to_num(values[box]) * gain, 0, 1), _PAPER)


def mark_pixels(image: np.ndarray, mask: np.ndarray, pixels: np.ndarray, gain: float) -> np.ndarray:
    """A photo (H, W, 3) in grey, with some pixels (H, W) bool in orange."""
    grey = np.repeat(0.7 * image.mean(axis=2, keepdims=True) * gain, 3, axis=2)
    return crop_image(np.where((pixels & mask)[..., None], _linear(OKABE_ITO[1]), grey), mask)


def signed_error(error: np.ndarray, mask: np.ndarray, gain: float) -> np.ndarray:
    """Errors of a layer (H, W, 3): orange above 0, blue below, the photo's white being 1 / gain."""
    mean = error.mean(axis=2, keepdims=True) * gain
    weight = np.clip(np.abs(mean) / _FULL, 0, 1)
    colour = np.where(mean > 0, _linear(OKABE_ITO[1]), _linear(OKABE_ITO[0]))
    return crop_image((1 - weight) * 0.85 + weight * colour, mask)


def height_colours(height: np.ndarray, mask: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Heights (H, W) in the colours of viridis between `limits`; white outside the mask and where
    unknown.
    """
    share = np.clip((np.nan_to_num(height) - limits[0]) / max(limits[1] - limits[0], 1e-9), 0, 1)
    colours = np.asarray(matplotlib.colormaps["viridis"](share))[..., :3]
    shown = np.where(np.isfinite(height)[..., None], srgb_to_linear(colours), _PAPER)
    return crop_image(shown, mask)


def normal_image(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Normals (H, W, 3) in the usual colours; white where unknown."""
    known = mask & np.isfinite(normal).all(axis=2)
    return np.asarray(normal_colours(np.nan_to_num(normal), known)[mask_slices(mask)])


def light_ball(light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A white ball under a light of coefficients (9, 3), (160, 160, 3) linear, and which pixels it
    covers.
    """
    normal, coverage = sphere_normals(_BALL)
    return np.exp(real_sh(normal) @ light), coverage > 0.5


def pad_to_aspect(picture: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """A square picture with white around it, in the proportions of the box of `mask` (H, W), so
    that a row of a sheet is of one height.
    """
    rows, columns = (part.stop - part.start for part in mask_slices(mask))
    side = len(picture)
    more = [max(0, round(side * (ratio - 1) / 2)) for ratio in (rows / columns, columns / rows)]
    return np.pad(picture, ((more[0],) * 2, (more[1],) * 2, (0, 0)), constant_values=_PAPER)


def fit_scale(values: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The map (H, W, 3) in the scale that brings it nearest to the true one inside the mask."""
    ours, theirs = values[mask].astype(float), truth[mask].astype(float)
    return values * ((ours * theirs).sum() / max(float((ours * ours).sum()), 1e-30))


def _linear(colour: str) -> np.ndarray:
    return np.asarray(srgb_to_linear(np.array(matplotlib.colors.to_rgb(colour))))
