"""The transfer curve of an image file: from stored codes to linear light, and back.

Equation, for a code x in [0, 1] (the real sRGB curve, never a power alone):
    linear = x / 12.92                      if x <= 0.04045
             ((x + 0.055) / 1.055)^2.4      otherwise

Citation: IEC 61966-2-1:1999; M. Stokes, M. Anderson, S. Chandrasekar, R. Motta, "A Standard Default
Color Space for the Internet - sRGB" (1996).

Limits: colour profiles and chromaticities in the file are not applied: the primaries are taken to
be those of Rec.709.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..imaging.srgb import linear_to_srgb, srgb_to_linear
from ..io.decoders.raster import Raster, as_rgb
from .names import TRANSFERS


def resolve_transfer(transfer: str, raster: Raster) -> str:
    """Return the transfer curve to use, "srgb" or "linear".

    Parameters
    ----------
    transfer : {"auto", "srgb", "linear"}
    raster : Raster

    Returns
    -------
    str

    Raises
    ------
    InputError
        If the name is unknown.
    """
    if transfer not in TRANSFERS:
        raise InputError(f"--transfer {transfer}: choose one of {', '.join(TRANSFERS)}")
    if transfer == "auto":
        return "linear" if raster.peak is None else "srgb"
    return transfer


def to_linear(raster: Raster, transfer: str) -> np.ndarray:
    """Convert a raster to linear light.

    Integer codes go through a table, so that each code has one exact value.

    Parameters
    ----------
    raster : Raster
    transfer : {"srgb", "linear"}

    Returns
    -------
    (H, W, 1 or 3) float32 ndarray
    """
    decode: Callable[[np.ndarray], np.ndarray] = (
        srgb_to_linear if transfer == "srgb" else np.asarray
    )
    if raster.peak is None:
        return decode(raster.values).astype(np.float32, copy=False)
    table = decode(np.arange(np.iinfo(raster.values.dtype).max + 1) / raster.peak).astype(
        np.float32
    )
    return table[raster.values]


def encode_like(raster: Raster, transfer: str, image: np.ndarray, changed: np.ndarray) -> Raster:
    """Encode an image as a raster is encoded, where it changed; other values keep every bit.

    Parameters
    ----------
    raster : Raster
        A grey one gets three channels if the new pixels have colour.
    transfer : {"srgb", "linear"}
    image : (H, W, 3) ndarray
        Linear; codes are rounded and clipped to the coding's range.
    changed : (H, W) bool ndarray

    Returns
    -------
    Raster
    """
    values = raster.values
    if values.shape[2] == 1 and (np.ptp(image[changed], axis=-1) > 0).any():
        values = as_rgb(values)
    coded = image[changed][:, : values.shape[2]]
    coded = linear_to_srgb(coded) if transfer == "srgb" else coded
    result = values.copy()
    result[changed] = coded if raster.peak is None else np.rint(np.clip(coded, 0, 1) * raster.peak)
    return replace(raster, values=result)
