"""Arrays in memory as images.

Integer arrays hold codes (sRGB by default), arrays of floats hold linear light, as in the files
that `reading` reads.
"""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..io.decoders.raster import Raster, check_size, raster_of_codes
from ..io.limits import DEFAULT_LIMITS, Limits


def raster_from_array(values: np.ndarray, name: str, limits: Limits = DEFAULT_LIMITS) -> Raster:
    """Return an array as if it had been read from a file.

    Parameters
    ----------
    values : (H, W), (H, W, 1), (H, W, 3) or (H, W, 4) ndarray
        Grey, RGB or RGBA. uint8 and uint16 are codes, floats are linear; alpha from 0 to the
        largest code, or 1. bool is a mask.
    name : str
        Prefix of the error messages.
    limits : Limits

    Returns
    -------
    Raster

    Raises
    ------
    InputError
        If the array is not an image.
    """
    if values.ndim not in (2, 3) or (values.ndim == 3 and values.shape[2] not in (1, 3, 4)):
        raise InputError(
            f"{name} has the shape {values.shape}: give (height, width), or (height, width, "
            "channels) with 1, 3 or 4 channels"
        )
    check_size(Path(name), limits, values.shape[1], values.shape[0])
    if values.dtype == bool:
        values = values.astype(np.uint8)
    elif values.dtype.kind == "f":
        values = values.astype(np.float32)
    elif values.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"{name} has the type {values.dtype}: give uint8 or uint16 codes, or linear floats"
        )
    values = np.ascontiguousarray(values)
    peak = 0 if values.dtype.kind == "f" else int(np.iinfo(values.dtype).max)
    digest = hashlib.sha256(values.tobytes()).hexdigest()
    return replace(raster_of_codes(values, peak), sha256=digest)
