"""NumPy arrays (.npy) as photos: floats are linear light, integers are codes."""

import math
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..limits import Limits
from ..npy import array_header
from .raster import Raster, check_size, raster_of_codes


def read_npy(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a NumPy array (H, W), (H, W, 1), (H, W, 3) or (H, W, 4).

    Alpha comes last and is not premultiplied. The size is checked from the header alone.

    Parameters
    ----------
    data : bytes
        The whole file.
    path : Path
        Named in errors.
    limits : Limits

    Returns
    -------
    Raster

    Raises
    ------
    InputError
        If the image is larger than the limits, or shape or type are not those of an image.
    """
    shape, by_columns, kind, start = array_header(data)
    if len(shape) not in (2, 3) or shape[2:] not in ((), (1,), (3,), (4,)):
        raise InputError(
            f"{path}: an array of shape {shape}: a photo is (H, W, 3), or (H, W, 4) with alpha, a "
            "mask (H, W)"
        )
    if kind.kind not in "fbu" or kind.itemsize > 8 or (kind.kind == "u" and kind.itemsize > 2):
        raise InputError(
            f"{path}: values of type {kind}: use floats of linear light, codes of 8 or 16 bits "
            "(uint8, uint16), or bool"
        )
    check_size(path, limits, shape[1], shape[0])
    stored = np.frombuffer(data, kind, math.prod(shape), start).reshape(
        shape, order="F" if by_columns else "C"
    )
    if kind.kind == "f":
        return raster_of_codes(stored.astype(np.float32), 0)
    stored = stored.astype(f"u{kind.itemsize}") * np.uint8(255 if kind.kind == "b" else 1)
    return raster_of_codes(stored, np.iinfo(stored.dtype).max)
