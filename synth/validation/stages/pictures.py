"""Maps as small pictures for the report: sRGB colours on a dark background, and PNG files as text
that an HTML page can embed.
"""

import base64
import io

import numpy as np
from PIL import Image

from isc_core.imaging.srgb import linear_to_srgb

LARGEST = 200  # side of a picture in the report, pixels
_BACKGROUND = 0.13  # sRGB, outside the mask
_TOO_BRIGHT, _TOO_DARK, _NO_ERROR = (
    np.array([1.0, 0.42, 0.04]),
    np.array([0.06, 0.3, 1.0]),
    np.array([0.06, 0.06, 0.06]),
)
_FULL_ERROR = 0.1  # of the photo's white: the colour saturates here
_LIGHT = np.array([-0.52, 0.58, 0.63])


def exposure(values: np.ndarray, mask: np.ndarray) -> float:
    """Return the gain for display: the 99.5th percentile of the brightest channel goes to 0.95.

    Parameters
    ----------
    values : (H, W, 3) ndarray
        Linear light.
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    float
        The gain; 1 for a black image.
    """
    bright = float(np.percentile(values[mask].max(axis=-1), 99.5))
    return 0.95 / bright if bright > 0 else 1.0


def lit(linear: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Convert linear light to display colours.

    Parameters
    ----------
    linear : (H, W, 3) ndarray
        Linear light, clipped to [0, 1].
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    (H, W, 3) ndarray
        sRGB colours in [0, 1], with a dark background.
    """
    return np.where(mask[..., None], linear_to_srgb(np.clip(linear, 0, 1)), _BACKGROUND)


def directions(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Show normals as colours: x (right) red, y (up) green, z (toward the viewer) blue.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        Unit normals.
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    (H, W, 3) ndarray
        sRGB colours in [0, 1], with a dark background.
    """
    return np.where(mask[..., None], np.clip(0.5 + 0.5 * normal, 0, 1), _BACKGROUND)


def signed_error(error: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Show signed errors as colours: orange for too bright, blue for too dark.

    Parameters
    ----------
    error : (H, W, 3) ndarray
        Errors, relative to the photo's white. Colours saturate at a tenth of it.
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    (H, W, 3) ndarray
        sRGB colours in [0, 1].
    """
    mean = error.mean(axis=2, keepdims=True)
    weight = np.clip(np.abs(mean) / _FULL_ERROR, 0, 1)
    return lit((1 - weight) * _NO_ERROR + weight * np.where(mean > 0, _TOO_BRIGHT, _TOO_DARK), mask)


def relief(height: np.ndarray, mask: np.ndarray, span: float) -> np.ndarray:
    """Show heights as a shaded relief, lit from the upper left and tinted from low to high.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.
    mask : (H, W) ndarray of bool
        The object.
    span : float
        Range of the tint around the median height, pixels.

    Returns
    -------
    (H, W, 3) ndarray
        sRGB colours in [0, 1].
    """
    inside = height[mask]
    flat = np.where(mask, height, np.median(inside))
    down, right = np.gradient(flat)
    normal = np.stack([-right, down, np.ones_like(flat)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    key = np.clip((normal @ _LIGHT + 0.3) / 1.3, 0, 1)[..., None]
    tint = np.clip((flat - np.median(inside)) / span + 0.5, 0, 1)[..., None]
    clay = (1 - tint) * np.array([0.36, 0.44, 0.52]) + tint * np.array([0.86, 0.78, 0.66])
    return lit(clay * (0.15 + 0.85 * key), mask)


def png_data(colors: np.ndarray) -> str:
    """Encode colours as a `data:` URL of a PNG, at most `LARGEST` pixels a side.

    Parameters
    ----------
    colors : (H, W, 3) ndarray
        In [0, 1]; values outside are clipped.

    Returns
    -------
    str
        The URL.
    """
    picture = Image.fromarray(np.rint(255 * np.clip(colors, 0, 1)).astype(np.uint8))
    if max(picture.size) > LARGEST:
        scale = LARGEST / max(picture.size)
        picture = picture.resize(
            (max(1, round(picture.width * scale)), max(1, round(picture.height * scale))),
            Image.Resampling.BOX,
        )
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
