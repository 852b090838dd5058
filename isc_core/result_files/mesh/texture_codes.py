"""Textures as 8-bit codes, and as PNG files: colours, unit vectors, opacities."""

import numpy as np

from ...imaging.srgb import share_codes, srgb_codes
from ...io.png import encode_png

_ROWS = 256  # coded at a time
_COMPRESSION = 4  # of 9: half of the time of 6 for a fiftieth more bytes


def color_codes(linear: np.ndarray) -> np.ndarray:
    """Return linear colours as 8-bit sRGB codes.

    Parameters
    ----------
    linear : (H, W, 3) ndarray

    Returns
    -------
    (H, W, 3) uint8 ndarray
    """
    codes = np.empty(linear.shape, np.uint8)
    for top in range(0, len(linear), _ROWS):  # to avoid large temporary arrays
        part = linear[top : top + _ROWS]
        codes[top : top + _ROWS] = srgb_codes(part)
    return codes


def vector_codes(vectors: np.ndarray) -> np.ndarray:
    """Return unit vectors as 8-bit codes, (n + 1) / 2.

    Parameters
    ----------
    vectors : (H, W, 3) ndarray

    Returns
    -------
    (H, W, 3) uint8 ndarray
    """
    codes = np.empty(vectors.shape, np.uint8)
    for top in range(0, len(vectors), _ROWS):
        part = vectors[top : top + _ROWS]
        codes[top : top + _ROWS] = np.rint(np.clip(part * 127.5 + 127.5, 0, 255))
    return codes


def alpha_codes(values: np.ndarray) -> np.ndarray:
    """Return values as the alpha of white pixels.

    Parameters
    ----------
    values : (H, W) ndarray
        In [0, 1]; clipped to it.

    Returns
    -------
    (H, W, 4) uint8 ndarray
    """
    pixels = np.full((*values.shape, 4), 255, np.uint8)
    pixels[..., 3] = share_codes(values)
    return pixels


def encoded_png(pixels: np.ndarray) -> bytes:
    """Return pixels as the bytes of a PNG.

    Parameters
    ----------
    pixels : (H, W), (H, W, 3) or (H, W, 4) uint8 ndarray

    Returns
    -------
    bytes
    """
    return encode_png(pixels, _COMPRESSION)
