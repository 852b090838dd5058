"""Arrays that several kernels take, and their types (see `numerics.kernel_types`)."""

from typing import NamedTuple

import numpy as np

PHOTO = "arrays.Photo(r[3] r[2] r[2] i8[2])"
SURFACE = "arrays.Surface(r[3] r[2] f8[1])"


class Photo(NamedTuple):
    """The image and where it is valid.

    Attributes
    ----------
    log_image : (H, C, W) ndarray
        Natural logarithm of the linear image.
    weight : (H, W) ndarray
        Per-pixel weight in [0, 1] of the reflectance terms, 0 where not valid.
    valid : (H, W) ndarray
        1 where the image is valid, else 0.
    spans : (H, 2) int64 ndarray
        First valid column of each row, and one past the last.
    """

    log_image: np.ndarray
    weight: np.ndarray
    valid: np.ndarray
    spans: np.ndarray


class Surface(NamedTuple):
    """The local geometry of the height map, and the slant term.

    Attributes
    ----------
    geometry : (H, 9, W) ndarray
        Rows zi zj zii zjj zij n1 n2 n3 and the mean curvature.
    slant_gradient : (H, W) ndarray
        Gradient of the slant term with respect to n3, unscaled.
    slant : (H,) ndarray
        Slant term of each row, unscaled.
    """

    geometry: np.ndarray
    slant_gradient: np.ndarray
    slant: np.ndarray


class Reflectance(NamedTuple):
    """Arrays of the reflectance in the space of the smoothness term and of the palette terms.

    Whitening matrices are (C, C); whitened log reflectances and their gradients are (H, C, W).
    """

    smoothness: np.ndarray
    palette: np.ndarray
