"""Maps as small pictures for the report: colours coded as sRGB on one dark ground, and PNG files as
text that a page can carry.
"""

import base64
import io

import numpy as np
from PIL import Image

from isc_core.photo.photo import linear_to_srgb

LARGEST = 200  # pixels a side of a picture in the report
_GROUND = 0.13  # sRGB, what is outside the mask
_TOO_BRIGHT, _TOO_DARK, _NO_ERROR = (
    np.array([1.0, 0.42, 0.04]),
    np.array([0.06, 0.3, 1.0]),
    np.array([0.06, 0.06, 0.06]),
)
_FULL_ERROR = 0.1  # of the photo's white: errors from here on have the full colour
_LAMP = np.array([-0.52, 0.58, 0.63])


def exposure(values: np.ndarray, mask: np.ndarray) -> float:
    """The gain that puts the 99.5th percentile of the brightest channel inside the mask at 0.95; 1
    for black.
    """
    bright = float(np.percentile(values[mask].max(axis=-1), 99.5))
    return 0.95 / bright if bright > 0 else 1.0


def lit(linear: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Linear light (H, W, 3) as colours."""
    return np.where(mask[..., None], linear_to_srgb(np.clip(linear, 0, 1)), _GROUND)


def directions(normal: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Unit normals (H, W, 3) as colours: x right red, y up green, z toward the viewer blue."""
    return np.where(mask[..., None], np.clip(0.5 + 0.5 * normal, 0, 1), _GROUND)


def signed_error(error: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Errors (H, W, 3), 1 being the photo's white, as colours: orange too bright, blue too dark,
    full from a tenth of white on.
    """
    mean = error.mean(axis=2, keepdims=True)
    weight = np.clip(np.abs(mean) / _FULL_ERROR, 0, 1)
    return lit((1 - weight) * _NO_ERROR + weight * np.where(mean > 0, _TOO_BRIGHT, _TOO_DARK), mask)


def relief(height: np.ndarray, mask: np.ndarray, span: float) -> np.ndarray:
    """Heights (H, W) as clay under a lamp at the upper left, tinted from low to high over `span`
    pixels around their middle.
    """
    inside = height[mask]
    flat = np.where(mask, height, np.median(inside))
    down, right = np.gradient(flat)
    normal = np.stack([-right, down, np.ones_like(flat)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    key = np.clip((normal @ _LAMP + 0.3) / 1.3, 0, 1)[..., None]
    tint = np.clip((flat - np.median(inside)) / span + 0.5, 0, 1)[..., None]
    clay = (1 - tint) * np.array([0.36, 0.44, 0.52]) + tint * np.array([0.86, 0.78, 0.66])
    return lit(clay * (0.15 + 0.85 * key), mask)


def png_data(colors: np.ndarray) -> str:
    """Colours (H, W, 3) in [0, 1] as a `data:` address of a PNG, made smaller where a side exceeds
    `LARGEST`.
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
