"""OpenEXR files as photos: the RGB or Y channels of one layer, in the display window."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from ...errors import InputError
from ..exr import in_frame, place_in_frame
from ..exr_header import ExrPart, check_exr, size_of
from ..limits import Limits
from ..native_io import memory_file
from .colour.space import ColourSpace, colorants_of
from .raster import Raster, check_size, raster_of_codes

# The display window around the data may be blank, but needs as much memory as data: largest number
# of its pixels, or of its multiple of the data's.
_FRAME_PIXELS, _FRAME_RATIO = 1 << 24, 16


def read_exr(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode the RGB or Y channels, and A, by which EXR colours are premultiplied.

    The frame is the display window, black where it has no data.

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
        If the image is larger than the limits, or the file is damaged.
    """
    for claimed in check_exr(data, path, limits):
        for window in (claimed.data, claimed.display):
            check_size(path, limits, *size_of(window))
        _check_frame(path, claimed)
    with memory_file(data) as file:
        parts = OpenEXR.File(str(file), separate_channels=True).parts
    if not parts:
        raise ValueError("the pixels cannot be read")
    layer = "{0}.{1}" if len(parts) > 1 else "{1}"
    by_name = {
        layer.format(part.name(), name): (channel.pixels, part.header)
        for part in parts
        for name, channel in part.channels.items()
    }
    names = _exr_channels(list(by_name), path)
    if len({by_name[name][0].shape for name in names}) > 1:
        raise InputError(f"{path}: its channels differ in size: save it as a plain RGB EXR")
    planes = [
        in_frame(pixels, *place_in_frame(header))
        for pixels, header in (by_name[name] for name in names)
    ]
    rgb = len(planes) >= 3
    if len(planes) == 2:
        planes = [planes[0]] * 3 + planes[1:]
    pixels, header = by_name[names[0]]
    raster = raster_of_codes(
        np.stack(planes, axis=2), 0, premultiplied=True, space=_space(header) if rgb else None
    )
    return replace(raster, bit_depth=8 * pixels.dtype.itemsize)


def _space(header: dict[str, Any]) -> ColourSpace | None:
    """The primaries of the attribute `chromaticities`; None without valid ones."""
    try:
        given = np.array(header["chromaticities"], float).reshape(4, 2)
        return ColourSpace("chromaticities of the EXR", colorants=colorants_of(given))
    except (KeyError, TypeError, ValueError):
        return None


def _check_frame(path: Path, claimed: ExrPart) -> None:
    """Raise `InputError` for a huge display window with little data."""
    data, frame = (math.prod(size_of(window)) for window in (claimed.data, claimed.display))
    if frame > max(_FRAME_PIXELS, _FRAME_RATIO * data):
        raise InputError(
            f"{path}: a display window of {frame / 1e6:.0f} megapixels around {data / 1e6:.2g} of "
            "data: crop the display window to the data"
        )


def _exr_channels(names: list[str], path: Path) -> list[str]:
    """R, G, B or Y, then A if present, of the unnamed layer or of the only layer that has them."""
    layers: dict[str, dict[str, str]] = {}
    for name in names:
        layer, _, channel = name.rpartition(".")
        layers.setdefault(layer, {})[channel.upper()] = name
    if len(names) == 1:
        return names
    for required in ("RGB", "Y"):
        fitting = [
            layer
            for layer, channels in layers.items()
            if set(required) <= channels.keys() and "RY" not in channels
        ]
        chosen = "" if "" in fitting else fitting[0] if len(fitting) == 1 else None
        if chosen is not None:
            return [layers[chosen][c] for c in required + "A" if c in layers[chosen]]
        if fitting:
            raise InputError(
                f"{path}: several layers ({', '.join(fitting)}): save one of them as a separate EXR"
            )
    raise InputError(
        f"{path}: no channels R, G, B or Y, only {', '.join(names[:8])}: save it as a plain RGB EXR"
    )
