"""Colour Retinex (Grosse et al. 2009), followed by shape from shading.

Problem: split log image = log shading + log reflectance.

Equation: a difference between neighbours belongs to reflectance where it is large in brightness
(its mean over the channels) or in chromaticity (the remainder), otherwise to shading; the shading
image is the least-squares integral of its differences. Its level in each channel, which differences
do not determine, is set to median 0, so the overall colour belongs to the reflectance.

Citation: R. Grosse, M. K. Johnson, E. H. Adelson, W. T. Freeman, "Ground truth dataset and baseline
evaluations for intrinsic image algorithms", ICCV 2009, 2335-2342, doi:10.1109/ICCV.2009.5459428;
after E. H. Land and J. J. McCann (1971), doi:10.1364/JOSA.61.000001. Shape by Ikeuchi & Horn 1981
(`ikeuchi_horn_1981`).

Limits: creases and shadow borders are attributed to reflectance, gradual changes of reflectance to
shading.
"""

from dataclasses import dataclass, field

import numpy as np

from .box import Box
from .from_shading import BaselineEstimate, check_log_image, from_log_shading
from .ikeuchi_horn_1981 import IkeuchiHorn1981Options, height_from_brightness
from .poisson import integrate


@dataclass(frozen=True)
class RetinexOptions:
    """Options of the classification of edges, and of the shape.

    Attributes
    ----------
    brightness_threshold : float
        Difference of natural logarithms above which a pair of neighbours is a reflectance edge, >=
        0.
    chromaticity_threshold : float
        The same for the norm of the channels' differences minus their mean.
    shape : IkeuchiHorn1981Options
    """

    brightness_threshold: float = 0.3
    chromaticity_threshold: float = 0.05
    shape: IkeuchiHorn1981Options = field(default_factory=IkeuchiHorn1981Options)


def estimate(
    log_image: np.ndarray, mask: np.ndarray, options: RetinexOptions | None = None
) -> BaselineEstimate:
    """Estimate shape and light from the shading of a textured object.

    Parameters
    ----------
    log_image : (H, W, 3) ndarray
        Natural logarithm of a linear image, finite in the mask.
    mask : (H, W) bool ndarray
    options : RetinexOptions, optional

    Returns
    -------
    BaselineEstimate

    Raises
    ------
    InputError
        If the mask is empty.
    """
    options = options or RetinexOptions()
    shading = log_shading(log_image, mask, options)
    return from_log_shading(
        shading, mask, lambda e, m, l: height_from_brightness(e, m, l, options.shape)
    )


def log_shading(
    log_image: np.ndarray, mask: np.ndarray, options: RetinexOptions | None = None
) -> np.ndarray:
    """Compute the log shading of a log image; the log reflectance is the remainder.

    Parameters
    ----------
    log_image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    options : RetinexOptions, optional

    Returns
    -------
    (H, W, 3) float64 ndarray
        Log shading, median 0 in the mask in every channel, 0 outside.

    Raises
    ------
    InputError
        For arrays of wrong shapes or an empty mask.
    """
    check_log_image(log_image, mask)
    options = options or RetinexOptions()
    box = Box.of(mask)
    inside = box.crop(mask)
    image = np.where(inside[..., None], box.crop(log_image), 0).astype(float)
    right, down = np.zeros_like(image), np.zeros_like(image)
    right[:, :-1], down[:-1] = np.diff(image, axis=1), np.diff(image, axis=0)
    for difference in (right, down):
        difference[_is_reflectance_edge(difference, options)] = 0
    shading = integrate(right, down, inside)
    shading[inside] -= np.median(shading[inside], axis=0)
    return np.where(mask[..., None], box.place(shading), 0)


def _is_reflectance_edge(difference: np.ndarray, options: RetinexOptions) -> np.ndarray:
    brightness = difference.mean(axis=2)
    chromaticity = np.linalg.norm(difference - brightness[..., None], axis=2)
    return (np.abs(brightness) > options.brightness_threshold) | (
        chromaticity > options.chromaticity_threshold
    )
