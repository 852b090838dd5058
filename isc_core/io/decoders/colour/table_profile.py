"""ICC profiles with tables of colours, applied by LittleCMS.

Problem: scanners and printers, and a few editors, describe colours by a table (`A2B0`) instead of
curves and colorants. LittleCMS interpolates it.

Limits: Pillow's binding converts with 8 bits per channel, so 16-bit photos lose half of theirs;
colours outside sRGB are clipped. Perceptual intent, LittleCMS's default.
"""

import io

import numpy as np
from PIL import Image, ImageCms


def check_table(profile: bytes) -> None:
    """Raise `ValueError` for a profile that LittleCMS cannot apply to RGB pixels.

    Parameters
    ----------
    profile : bytes
    """
    _transform(profile)


def table_to_srgb(values: np.ndarray, peak: int, profile: bytes) -> np.ndarray:
    """Convert codes by a profile that `check_table` accepts.

    Parameters
    ----------
    values : (H, W, 3) ndarray
        Integer codes.
    peak : int
        The largest code.
    profile : bytes

    Returns
    -------
    (H, W, 3) ndarray of uint8
        sRGB.
    """
    codes = values if peak == 255 else np.rint(values * (255 / peak)).astype(np.uint8)
    image = Image.fromarray(np.ascontiguousarray(codes))
    ImageCms.applyTransform(image, _transform(profile), inPlace=True)
    return np.asarray(image)


def _transform(profile: bytes) -> ImageCms.ImageCmsTransform:
    try:
        return ImageCms.buildTransform(
            ImageCms.ImageCmsProfile(io.BytesIO(profile)), ImageCms.createProfile("sRGB"),
            "RGB", "RGB",
        )  # fmt: skip
    except (ImageCms.PyCMSError, OSError) as error:
        raise ValueError("LittleCMS cannot apply the profile") from error
