"""From stored codes to linear Rec.709 light, and back.

Equation, for a code x in [0, 1] (the exact sRGB curve, not a power law):
    linear = x / 12.92                      if x <= 0.04045
             ((x + 0.055) / 1.055)^2.4      otherwise
For a file that states a colour space, its curves and primaries are used, see `primaries`.

Citation: IEC 61966-2-1:1999; M. Stokes, M. Anderson, S. Chandrasekar, R. Motta, "A Standard Default
Color Space for the Internet - sRGB" (1996).

Limits: a curve that the user chooses replaces that of the file; the file's primaries remain. Float
files are linear, even if they state another curve. Colours outside of Rec.709 are clipped at 0.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..imaging.bounding_box import FramePart
from ..imaging.row_blocks import row_blocks
from ..imaging.srgb import linear_to_srgb, srgb_to_linear
from ..io.decoders.colour.space import ColourSpace
from ..io.decoders.raster import Raster, as_rgb
from .names import TRANSFERS
from .primaries import in_rec709, to_rec709

PROFILE = "profile"
_CODES = np.arange(256) / 255
_HALF_A_CODE = 0.5 / 255
_CHUNK = 1 << 15  # pixels looked up at a time: NumPy makes an index of 8 bytes for each


def resolve_transfer(transfer: str, raster: Raster) -> str:
    """Return the transfer curve to use.

    Parameters
    ----------
    transfer : {"auto", "srgb", "linear"}
    raster : Raster

    Returns
    -------
    str
        "srgb", "linear", or "profile" for another one that the file states.

    Raises
    ------
    InputError
        If the name is unknown.
    """
    if transfer not in TRANSFERS:
        raise InputError(f"--transfer {transfer}: choose one of {', '.join(TRANSFERS)}")
    if transfer != "auto":
        return transfer
    return "linear" if raster.peak is None else _curve_of(raster.space)


def _curve_of(space: ColourSpace | None) -> str:
    """The name of a colour space's curve; that of sRGB or linear if within half an 8-bit code."""
    if space is not None and space.is_table:
        return PROFILE
    if space is None or not space.curves:
        return "srgb"
    light = np.stack([curve(_CODES) for curve in space.curves])
    for name, codes in (("srgb", linear_to_srgb(light)), ("linear", light)):
        if np.abs(codes - _CODES).max() < _HALF_A_CODE:
            return name
    return PROFILE


def to_linear(raster: Raster, transfer: str) -> np.ndarray:
    """Convert a raster to linear Rec.709.

    Integer codes are looked up in a table, so that each code has one exact value.

    Parameters
    ----------
    raster : Raster
    transfer : {"srgb", "linear", "profile"}

    Returns
    -------
    (H, W, 1 or 3) float32 ndarray
    """
    space = raster.space
    if transfer == PROFILE and space is not None and space.is_table and raster.peak is not None:
        from ..io.decoders.colour.table_profile import table_to_srgb  # LittleCMS

        codes = table_to_srgb(raster.values, raster.peak, space.profile)
        return to_linear(replace(raster, values=codes, peak=255, space=None), "srgb")
    linear = _decoded(raster, transfer)
    matrix = to_rec709(space)
    return linear if matrix is None or linear.shape[2] == 1 else in_rec709(linear, matrix)


def _decoded(raster: Raster, transfer: str) -> np.ndarray:
    """Linear light (H, W, 1 or 3) of the file's own primaries."""
    curves = curves_of(raster, transfer)
    if raster.peak is None:
        return np.asarray(curves[0](raster.values), np.float32)
    codes = np.arange(np.iinfo(raster.values.dtype).max + 1) / raster.peak
    tables = [curve(codes).astype(np.float32) for curve in curves]
    linear = np.empty(raster.values.shape, np.float32)
    for block in row_blocks(linear.shape, pixels=_CHUNK):
        stored, light = raster.values[block.rows], linear[block.rows]
        if len(tables) == 1:
            np.take(tables[0], stored, out=light, mode="clip")
        else:
            for c, table in enumerate(tables):
                light[..., c] = table[stored[..., c]]
    return linear


def curves_of(raster: Raster, transfer: str) -> tuple[Callable[[np.ndarray], np.ndarray], ...]:
    """Return the curves from codes in [0, 1] to linear light.

    Parameters
    ----------
    raster : Raster
    transfer : {"srgb", "linear", "profile"}
        Profiles with tables are treated as sRGB.

    Returns
    -------
    tuple of callable
        One for all channels, or one per channel.
    """
    if transfer == PROFILE and raster.space is not None and raster.space.curves:
        return raster.space.curves
    return (np.asarray,) if transfer == "linear" else (srgb_to_linear,)


def encode_like(
    raster: Raster,
    transfer: str,
    image: np.ndarray,
    changed: np.ndarray,
    part: FramePart | None = None,
) -> Raster:
    """Encode the changed pixels of an image like a raster; other values keep every bit.

    A raster of a colour space that a PNG cannot represent becomes one of 16-bit sRGB.

    Parameters
    ----------
    raster : Raster
        A grey one gets three channels if the new pixels have colour.
    transfer : {"srgb", "linear", "profile"}
    image : (h, w, 3) ndarray
        Linear Rec.709; codes are rounded and clipped to the coding's range.
    changed : (h, w) bool ndarray
    part : FramePart, optional
        The part of the raster that `image` and `changed` are of; by default all of it.

    Returns
    -------
    Raster
    """
    coloured = bool((np.ptp(image[changed], axis=-1) > 0).any())
    if raster.peak is not None:
        channels = 3 if coloured or raster.alpha is not None else raster.values.shape[2]
        raster, transfer = _for_png(raster, transfer, channels)
    values = raster.values
    if values.shape[2] == 1 and coloured:
        values = as_rgb(values)
    light, matrix = image[changed], to_rec709(raster.space)
    if matrix is not None and values.shape[2] == 3 and raster.peak is not None:
        light = np.clip(light @ np.linalg.inv(matrix).T.astype(np.float32), 0, 1)
    coded = _encoded(light[:, : values.shape[2]], raster, transfer)
    result = values.copy()
    inside = result if part is None else part.cut(result)
    inside[changed] = coded if raster.peak is None else np.rint(np.clip(coded, 0, 1) * raster.peak)
    return replace(raster, values=result)


def _for_png(raster: Raster, transfer: str, channels: int) -> tuple[Raster, str]:
    """The raster in a space that a PNG of so many channels can represent, with its own profile or
    as sRGB, and its curve.
    """
    space = raster.space
    if space is None:
        return raster, transfer
    # A PNG may have a grey profile for grey pixels only, and one of RGB for the others only.
    fits = space.profile[16:20] == (b"RGB " if channels == 3 else b"GRAY")
    if to_rec709(space) is None and transfer == _curve_of(space) == "srgb":
        return (raster if fits else replace(raster, space=None)), transfer
    if fits and not space.is_table and raster.values.shape[2] == channels:
        return raster, transfer
    return _as_srgb(raster, transfer), "srgb"


def _as_srgb(raster: Raster, transfer: str) -> Raster:
    codes = np.rint(65535 * np.clip(linear_to_srgb(to_linear(raster, transfer)), 0, 1))
    return replace(raster, values=codes.astype(np.uint16), peak=65535, bit_depth=16, space=None)


def _encoded(light: np.ndarray, raster: Raster, transfer: str) -> np.ndarray:
    """Codes in [0, 1] of linear light (N, C)."""
    if transfer != PROFILE:
        return linear_to_srgb(light) if transfer == "srgb" else light
    codes = np.linspace(0.0, 1.0, 65536)
    curves = curves_of(raster, transfer)
    planes = (
        np.interp(light[:, c], curves[min(c, len(curves) - 1)](codes), codes)
        for c in range(light.shape[1])
    )
    return np.stack([*planes], axis=1)
