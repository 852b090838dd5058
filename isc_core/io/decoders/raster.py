"""The raster that every decoder returns, and the checks that all of them share."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..limits import Limits

MAX_ASPECT = 100
MIN_SIDE = 8


@dataclass(frozen=True)
class Raster:
    """What an image file stores, upright (its rotation flag applied), before any transfer curve.

    `values`: (H, W, 1) grey or (H, W, 3) RGB; uint8 or uint16 codes, or float32.
    `alpha`: (H, W) float32 in [0, 1], or None. `values` are not multiplied by it.
    `peak`: the largest code that the file can hold; None for floats.
    `bit_depth`: bits a channel. `sha256`: of the whole file.
    """

    values: np.ndarray
    alpha: np.ndarray | None
    peak: int | None
    bit_depth: int
    sha256: str = ""

    @property
    def transparency(self) -> np.ndarray | None:
        """The alpha channel where it tells something: None where it is opaque everywhere."""
        return None if self.alpha is None or not (self.alpha < 1).any() else self.alpha


def check_size(path: Path, limits: Limits, width: int, height: int) -> None:
    """Refuses, from the header alone, what would not fit or cannot be an object's photo."""
    limits.check_pixels(path, width, height)
    if min(width, height) < MIN_SIDE:
        raise InputError(
            f"{path}: {width} x {height} pixels; at least {MIN_SIDE} are needed both ways: use a larger photo"
        )
    if max(width, height) > MAX_ASPECT * min(width, height):
        raise InputError(
            f"{path}: {width} x {height} pixels; one side is over {MAX_ASPECT} times the other: crop it to the object"
        )


def raster_of_codes(
    codes: np.ndarray, peak: int, orientation: int = 1, premultiplied: bool = False
) -> Raster:
    """A raster of (H, W), (H, W, 1), (H, W, 3) or (H, W, 4) integer codes or float values, alpha
    last.
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
    return Raster(values, alpha, None if is_float else peak, 32 if is_float else peak.bit_length())


def _upright(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Applies an EXIF orientation, 1 to 8 (others count as 1), to (H, W, C) pixels: 5 to 8 swap the
    axes, the rest are flips.
    """
    if orientation in (5, 6, 7, 8):
        pixels = pixels.transpose(1, 0, 2)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return pixels


def as_rgb(values: np.ndarray) -> np.ndarray:
    return np.repeat(values, 3, axis=2) if values.shape[2] == 1 else values
