"""The raster that every decoder returns, and shared checks."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..focal_length import FocalLength
from ..limits import Limits
from ..reading_notes import ReadingNote
from .colour.space import ColourSpace

MAX_ASPECT = 100
MIN_SIDE = 8


@dataclass(frozen=True, eq=False)
class Raster:
    """The stored values of an image file, upright (its orientation applied), before any transfer
    curve.

    Attributes
    ----------
    values : (H, W, 1) or (H, W, 3) ndarray
        Grey or RGB; uint8 or uint16 codes, or float32. Not multiplied by alpha.
    alpha : (H, W) float32 ndarray or None
        In [0, 1].
    peak : int or None
        Largest code of the format; None for floats.
    bit_depth : int
        Bits per channel.
    sha256 : str
        Of the whole file.
    space : ColourSpace or None
        The colour space of the file; None where it states none.
    saturated : (H, W) bool ndarray or None
        Where the sensor was saturated; None where only the largest code shows it.
    notes : tuple of ReadingNote
        Assumptions and omissions.
    focal_length : FocalLength or None
        From the metadata; None without one.
    """

    values: np.ndarray
    alpha: np.ndarray | None
    peak: int | None
    bit_depth: int
    sha256: str = ""
    space: ColourSpace | None = None
    saturated: np.ndarray | None = None
    notes: tuple[ReadingNote, ...] = ()
    focal_length: FocalLength | None = None

    @property
    def transparency(self) -> np.ndarray | None:
        """The alpha channel, or None where it is opaque everywhere."""
        return None if self.alpha is None or not (self.alpha < 1).any() else self.alpha


def check_size(path: Path, limits: Limits, width: int, height: int) -> None:
    """Raise `InputError` for a size that is too large or implausible for a photo of an object.

    Parameters
    ----------
    path : Path
        Prefix of the error message.
    limits : Limits
    width, height : int
        From the header.
    """
    limits.check_pixels(path, width, height)
    if min(width, height) < MIN_SIDE:
        raise InputError(
            f"{path}: {width} x {height} pixels; each side needs at least {MIN_SIDE}: use a "
            "larger photo"
        )
    if max(width, height) > MAX_ASPECT * min(width, height):
        raise InputError(
            f"{path}: {width} x {height} pixels; one side is more than {MAX_ASPECT} times the "
            "other: crop it to the object"
        )


def raster_of_codes(
    codes: np.ndarray,
    peak: int,
    orientation: int = 1,
    premultiplied: bool = False,
    space: ColourSpace | None = None,
    notes: tuple[ReadingNote, ...] = (),
) -> Raster:
    """Build a raster from integer codes or floats.

    Parameters
    ----------
    codes : ndarray
        (H, W), (H, W, 1), (H, W, 3) or (H, W, 4), alpha last.
    peak : int
        Largest code; ignored for floats.
    orientation : int
        EXIF orientation.
    premultiplied : bool
        Whether colours are multiplied by alpha.
    space : ColourSpace, optional
    notes : tuple of ReadingNote

    Returns
    -------
    Raster
    """
    codes = _upright(codes if codes.ndim == 3 else codes[..., None], orientation)
    is_float = codes.dtype.kind == "f"
    values, alpha = codes[..., :3], None
    if codes.shape[2] == 4:
        alpha = np.clip(codes[..., 3].astype(np.float32) / (1 if is_float else peak), 0.0, 1.0)
        if premultiplied:
            coded = values / np.where(alpha > 0, alpha, 1)[..., None]
            values = (
                coded.astype(np.float32)
                if is_float
                else np.minimum(np.rint(coded), peak).astype(codes.dtype)
            )
    return Raster(
        values,
        alpha,
        None if is_float else peak,
        32 if is_float else peak.bit_length(),
        space=space,
        notes=notes,
    )


def _upright(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Apply an EXIF orientation, 1 to 8 (others are treated as 1), to (H, W, C) pixels: 5 to 8 swap
    the axes, the rest are flips.
    """
    if orientation in (5, 6, 7, 8):
        pixels = pixels.transpose(1, 0, 2)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return pixels


def as_rgb(values: np.ndarray) -> np.ndarray:
    """Repeat a single channel three times.

    Parameters
    ----------
    values : (H, W, 1) or (H, W, 3) ndarray

    Returns
    -------
    (H, W, 3) ndarray
        `values` itself if it has three channels.
    """
    return np.repeat(values, 3, axis=2) if values.shape[2] == 1 else values
