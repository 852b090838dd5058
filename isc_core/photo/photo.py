"""A photo and its mask, as linear light.

Problem: files store codes (8 or 16 bits, mostly sRGB-coded) or floats; everything behind this
module works on linear Rec.709 light with a mask. Equation, for a code x in [0, 1] (the real sRGB
curve, never a power alone):
    linear = x / 12.92                      if x <= 0.04045
             ((x + 0.055) / 1.055)^2.4      otherwise
Citation: IEC 61966-2-1:1999; Stokes, Anderson, Chandrasekar, Motta, "A Standard Default Color Space
for the Internet - sRGB" (1996). Resizing averages linear light over the area of each new pixel,
weighted by the mask and normalised: the premultiplied images of Porter & Duff, "Compositing Digital
Images" (1984), doi:10.1145/800031.808606. Neither the background nor the object bleeds into the
other. Limits: colour profiles and chromaticities in the file are not applied, the primaries are
taken to be Rec.709; of a file with several pages the first is read.
"""

import errno
import functools
import hashlib
import io
import math
import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
from PIL import (
    BmpImagePlugin,
    Image,
    JpegImagePlugin,
    PngImagePlugin,
    PpmImagePlugin,
    TiffImagePlugin,
)
from scipy import sparse

from ..errors import InputError
from ..imaging.bounding_box import mask_slices
from ..imaging.srgb import linear_to_srgb as linear_to_srgb
from ..imaging.srgb import srgb_to_linear as srgb_to_linear
from ..io.exr_header import check_exr, size_of
from ..io.limits import USUAL, Limits
from ..io.native_io import memory_file, suppress_native_output
from ..io.npy import array_header

TRANSFERS = ("auto", "srgb", "linear")
MAX_ASPECT = 100
MIN_SIDE = 8
MIN_MASK_PIXELS = 64
BLACK = 2.0 / 255.0
FLOAT_STEP = 2.0**-14
_WILD = 1e9  # times the median light of the object: no lamp shows that bright, a broken pixel does

_ORIENTATION_TAG = 0x0112
_DECODING_ERRORS = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    IndexError,
    KeyError,
    RuntimeError,
    EOFError,
    OverflowError,
    MemoryError,
    struct.error,
    zlib.error,
    cv2.error,
    Image.DecompressionBombError,
)


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


@dataclass(frozen=True)
class PhotoSource:
    """The file a photo comes from.

    `sha256` of the file; `size` = (width, height) after rotation; `bit_depth` a channel; `transfer`
    used, "srgb" or "linear"; `mask_from`: "file", "alpha", "black border" or "whole frame".
    """

    sha256: str
    size: tuple[int, int]
    bit_depth: int
    transfer: str
    mask_from: str


@dataclass(frozen=True)
class Photo:
    """One photo of an object.

    `image`: (H, W, 3) float32, linear Rec.709, finite and >= 0 everywhere; a grey file has three
    equal channels. `mask`: (H, W) bool, the object. A pixel of the object may have channels that
    are zero. `code_value`: the smallest step of the file's coding near black, in linear light:
    `srgb_to_linear(1/255)` for 8-bit sRGB, 1/65535
        for 16-bit linear. Floats have no such step: 2^-14 of the object's white (its 99.9th
        percentile), the step of a 14-bit sensor, so that the exposure of a file does not matter.
        Zero channels are floored at half of it, in logarithms only.
    `clipped`: (H, W) bool, some channel is at the coding's maximum, so the light may have been
    brighter; never in float files.
        After resizing: some part of the object's pixel is.
    `exposed`: whether the numbers tell how bright the scene was exposed, 1 being white: of codes
    they do, of floats they need not. `original`: the file. `scale`: working size / original size; a
    working pixel coordinate is `scale` times the original's.
    """

    image: np.ndarray
    mask: np.ndarray
    code_value: float
    clipped: np.ndarray
    original: PhotoSource
    scale: float = 1.0
    exposed: bool = True

    @property
    def box(self) -> tuple[int, int, int, int]:
        """(x, y, width, height) of the mask, in pixels of `image`."""
        return mask_box(self.mask)

    def resized_to_object(self, max_size: int = 512) -> "Photo":
        """The photo at the scale where the long side of the mask's box is at most `max_size`
        pixels; 0 keeps the size; never enlarges.

        Linear light is averaged over the area of each new pixel, object and background apart; the
        mask is where the object covers half. Raises `InputError` where `max_size` is negative or
        leaves the object thinner than 8 pixels.
        """
        if max_size < 0:
            raise InputError(
                f"--max-size {max_size}: give the long side of the object in pixels, or 0 to keep the photo's size"
            )
        longest = max(self.box[2:])
        if max_size == 0 or longest <= max_size:
            return self
        factor = max_size / longest
        while True:
            area = _AreaFilter.of(self.mask.shape, factor)
            cover = area(self.mask)
            mask = cover >= 0.5 * area.full
            if not mask.any() or max(mask_box(mask)[2:]) <= max_size:
                break
            factor *= 1.0 - 0.25 / max_size
        thin = min(mask_box(mask)[2:]) if mask.any() else 0
        if thin < MIN_SIDE:
            raise InputError(
                f"--max-size {max_size} leaves the object only {thin} pixels thin: use {_size_needed(self.box)} or more, or 0"
            )
        clipped = mask & (area(self.clipped & self.mask) > 1e-6)
        return replace(
            self,
            image=_resize_apart(self.image, self.mask, mask, area),
            mask=mask,
            clipped=clipped,
            scale=self.scale * factor,
        )


def _size_needed(box: tuple[int, int, int, int]) -> int:
    return int(np.ceil((MIN_SIDE + 1) * max(box[2:]) / min(box[2:])))


# --- transfer -------------------------------------------------------------------------------------


def _transfer_used(transfer: str, raster: Raster) -> str:
    if transfer not in TRANSFERS:
        raise InputError(f"--transfer {transfer}: choose one of {', '.join(TRANSFERS)}")
    if transfer == "auto":
        return "linear" if raster.peak is None else "srgb"
    return transfer


def _to_linear(raster: Raster, transfer: str) -> np.ndarray:
    """(H, W, 1 or 3) float32 linear light; integer codes go through a table, so that each has one
    exact value.
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


def _as_rgb(values: np.ndarray) -> np.ndarray:
    return np.repeat(values, 3, axis=2) if values.shape[2] == 1 else values


def read_linear(
    path: str | Path, transfer: str = "auto", limits: Limits = USUAL, *, finite: bool = False
) -> np.ndarray:
    """The whole image without a mask: (H, W, 3) float32, linear Rec.709; what is not finite or
    negative in a float file becomes 0.

    Raises `InputError` as `read_photo` does, and with `finite` for values that are not.
    """
    raster = read_raster(path, limits)
    if finite and not np.isfinite(raster.values).all():
        raise InputError(
            f"{path} holds NaN or infinite values: light that bright has to be clipped, or saved as 32-bit floats"
        )
    linear = _as_rgb(_to_linear(raster, _transfer_used(transfer, raster)))
    return np.where(np.isfinite(linear) & (linear > 0), linear, np.float32(0))


# --- the photo ------------------------------------------------------------------------------------


def read_photo(
    path: str | Path,
    mask_path: str | Path | None = None,
    transfer: str = "auto",
    *,
    whole_frame: bool = False,
    limits: Limits = USUAL,
) -> Photo:
    """Reads a photo at full size.

    Files: PNG, JPEG, TIFF, EXR, Radiance HDR, BMP, PPM, PGM, NumPy's .npy (its integers are codes),
    told apart by their content. `transfer`: "srgb", "linear", or "auto" = floats linear, all others
    sRGB. The mask is `mask_path` (inside = above half of its largest value, or its alpha channel
    where that is not opaque); else the photo's alpha channel (>= 0.5) where that is not opaque;
    else, on a black border (at most 2/255 in sRGB coding), the pixels that are not black: holes
    filled, parts smaller than 1 % of the largest dropped. Where there is none of these,
    `whole_frame` takes all pixels. Raises `InputError`, one line with the remedy, for anything that
    cannot be used; what is beyond `limits` is told from the file's header.
    """
    raster = read_raster(path, limits)
    used = _transfer_used(transfer, raster)
    _refuse_constant(raster.values, f"{path}: every pixel")
    linear = _to_linear(raster, used)
    mask, mask_from = _find_mask(path, raster, linear, mask_path, whole_frame, limits)
    check_mask(mask, f"{path if mask_path is None else mask_path}: the mask")
    _refuse_constant(raster.values[mask], f"{path}: every pixel inside the mask")
    height, width = mask.shape
    return Photo(
        image=_as_rgb(linear if raster.peak is not None else _valid_light(linear, mask, path)),
        mask=mask,
        code_value=_code_value(raster, used, linear, mask),
        clipped=np.zeros_like(mask)
        if raster.peak is None
        else _brightest(raster.values) == raster.peak,
        original=PhotoSource(raster.sha256, (width, height), raster.bit_depth, used, mask_from),
        exposed=raster.peak is not None,
    )


def _refuse_constant(values: np.ndarray, what: str) -> None:
    first = values.reshape(-1, values.shape[-1])[0]
    if (values == first).all():
        raise InputError(
            f"{what} is {'the same' if first.any() else 'black'}: there is nothing to recover; use another photo"
        )


def _valid_light(linear: np.ndarray, mask: np.ndarray, path: str | Path) -> np.ndarray:
    """The image with zeros for unusable values outside the mask; raises `InputError` for those
    inside.
    """
    brightest, wild = _brightest(linear), f"brighter than {_WILD:g} times most of the object"
    for bad, what in (
        (~np.isfinite(linear).all(axis=2), "NaN or infinite"),
        ((linear < 0).any(axis=2), "negative"),
        (brightest > _WILD * _usual(brightest[mask]), wild),
    ):
        count = int((bad & mask).sum())
        if count:
            raise InputError(
                f"{path}: {count} pixels inside the mask are {what}: mend them, or leave them out of the mask"
            )
        if bad.any():
            linear = np.where(bad[..., None], np.float32(0), linear)
    return linear


def _usual(light: np.ndarray) -> float:
    """The median of the values (N,) above 0, infinite where none is."""
    light = light[light > 0]
    return float(np.median(light)) if light.size else np.inf


def _brightest(values: np.ndarray) -> np.ndarray:
    """(H, W): the largest channel of (H, W, C).

    NumPy's own maximum over a short last axis is ten times slower.
    """
    return functools.reduce(np.maximum, np.moveaxis(values, 2, 0))


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, np.zeros(1, values.dtype))


def _code_value(raster: Raster, transfer: str, linear: np.ndarray, mask: np.ndarray) -> float:
    if raster.peak is None:
        light = _brightest(linear)[mask]
        return FLOAT_STEP * float(np.percentile(light, 99.9) or light.max())
    step = 1.0 / raster.peak
    return float(srgb_to_linear(step)) if transfer == "srgb" else step


# --- the mask -------------------------------------------------------------------------------------


def mask_box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """(x, y, width, height) of the smallest box around the true pixels of an (H, W) mask that has
    some.
    """
    rows, columns = mask_slices(mask)
    return (
        int(columns.start),
        int(rows.start),
        int(columns.stop - columns.start),
        int(rows.stop - rows.start),
    )


def check_mask(mask: np.ndarray, what: str) -> None:
    """Raises `InputError`, its line opened by `what`, for an (H, W) mask that is empty, has fewer
    than 64 pixels or is thinner than 8.
    """
    count = int(mask.sum())
    if count == 0:
        raise InputError(f"{what} is empty: mark the object in white on black")
    if count < MIN_MASK_PIXELS:
        raise InputError(
            f"{what} has only {count} pixels: at least {MIN_MASK_PIXELS} are needed; use a larger photo or mask"
        )
    width, height = mask_box(mask)[2:]
    if min(width, height) < MIN_SIDE:
        raise InputError(
            f"{what} is only {width} x {height} pixels: at least {MIN_SIDE} are needed both ways; use a larger photo or mask"
        )


def tidy_mask(mask: np.ndarray) -> np.ndarray:
    """An (H, W) mask with its holes filled, without the parts that are smaller than 1 % of the
    largest part.
    """
    _, labels = cv2.connectedComponents((~mask).astype(np.uint8), connectivity=4)
    outside = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    filled = mask | ~np.isin(labels, outside)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(filled.astype(np.uint8), connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0
    return (areas >= max(0.01 * areas.max(), 1))[labels]


def _find_mask(
    path: str | Path,
    raster: Raster,
    linear: np.ndarray,
    mask_path: str | Path | None,
    whole_frame: bool,
    limits: Limits,
) -> tuple[np.ndarray, str]:
    if mask_path is not None:
        return _mask_of_file(mask_path, raster, limits), "file"
    if raster.transparency is not None:
        return raster.transparency >= 0.5, "alpha"
    light = _finite(_brightest(linear))
    if not (light > 0).any():
        raise InputError(
            f"{path}: the image is black: there is nothing to recover; use another photo"
        )
    # A float file has no coding white: its brightest percent stands in for it.
    white = 1.0 if raster.peak is not None else float(np.percentile(light[light > 0], 99.0))
    lit = light > white * float(srgb_to_linear(BLACK))
    if lit[0].any() or lit[-1].any() or lit[:, 0].any() or lit[:, -1].any():
        if whole_frame:
            return np.ones_like(lit), "whole frame"
        raise InputError(
            f"{path}: there is no mask, no transparency and no black border to find the object by: "
            "make a mask with `isc mask PHOTO --box x,y,w,h -o MASK` and give it with --mask"
        )
    if not lit.any():
        raise InputError(
            f"{path}: the image is almost black: there is nothing to recover; use another photo"
        )
    return tidy_mask(lit), "black border"


def _mask_of_file(mask_path: str | Path, photo: Raster, limits: Limits) -> np.ndarray:
    raster = read_raster(mask_path, limits)
    if raster.values.shape[:2] != photo.values.shape[:2]:
        (h, w), (mask_h, mask_w) = photo.values.shape[:2], raster.values.shape[:2]
        raise InputError(
            f"{mask_path}: the mask is {mask_w} x {mask_h} pixels, the photo {w} x {h}: give a mask of the photo's size"
        )
    if raster.transparency is not None:
        return raster.transparency >= 0.5
    values = _finite(_brightest(raster.values))
    # Half of the largest value, not of the coding's maximum: masks of 0 and 1 are common.
    return values > 0.5 * max(float(values.max()), 0.0)


# --- resizing -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _AreaFilter:
    """Integrates an (H, W) array over square pixels of side 1/factor, exactly; the last row and
    column may reach past the image.
    """

    rows: Any
    columns: Any
    full: np.ndarray

    @staticmethod
    def of(shape: tuple[int, ...], factor: float) -> "_AreaFilter":
        rows, columns = _overlaps(shape[0], factor), _overlaps(shape[1], factor)
        return _AreaFilter(rows, columns, np.outer(rows.sum(axis=1), columns.sum(axis=1)))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return (self.columns @ (self.rows @ values.astype(np.float32, copy=False)).T).T


def _overlaps(count: int, factor: float) -> Any:
    """Sparse (new, old) float32: the part of each new pixel that each of the `count` old pixels
    covers; 0 < factor <= 1.
    """
    new = max(1, int(np.ceil(count * factor - 1e-6)))
    start, end = np.arange(count) * factor, np.arange(1, count + 1) * factor
    first = np.minimum(start.astype(int), new - 1)
    split = np.clip(first + 1.0, start, end)
    second = np.minimum(first + 1, new - 1)
    weights = np.concatenate([split - start, end - split]).astype(np.float32)
    old = np.arange(count)
    return sparse.csr_matrix(
        (weights, (np.concatenate([first, second]), np.concatenate([old, old]))), shape=(new, count)
    )


def averaged_object(
    image: np.ndarray, mask: np.ndarray, long_side: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """`averaged` of the object's box, at most `long_side` pixels long."""
    box = mask_slices(mask)
    return averaged(image[box], mask[box], min(1.0, long_side / max(mask[box].shape)))


def averaged(
    image: np.ndarray, mask: np.ndarray, factor: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """`image` (H, W, 3) and `mask` (H, W) bool, `factor` times as large, 0 < factor <= 1: means of
    the mask's light over the new pixels, and the pixels of which the mask covers half, or any,
    where that leaves none. Returns (h, w, 3) float32, (h, w) bool, and the factor.
    """
    if factor >= 1:
        return np.where(mask[..., None], image, 0).astype(np.float32), mask, 1.0
    area = _AreaFilter.of(mask.shape, factor)
    cover = area(mask)
    inside = cover >= 0.5 * area.full
    inside = inside if inside.any() else cover > 0
    return np.where(inside[..., None], _resize_apart(image, mask, inside, area), 0), inside, factor


def _resize_apart(
    image: np.ndarray, mask: np.ndarray, new_mask: np.ndarray, area: _AreaFilter
) -> np.ndarray:
    """Means of `image` over the new pixels: of the object's pixels alone inside `new_mask`, of the
    others alone outside.
    """
    result = np.empty((*new_mask.shape, image.shape[2]), np.float32)
    weight = np.where(new_mask, area(mask), area(~mask))
    for channel in range(image.shape[2]):
        plane = image[..., channel]
        total = np.where(new_mask, area(plane * mask), area(plane * ~mask))
        result[..., channel] = np.divide(total, weight, out=np.zeros_like(total), where=weight > 0)
    return result


# --- files ----------------------------------------------------------------------------------------


def read_raster(path: str | Path, limits: Limits = USUAL) -> Raster:
    """The values that an image file stores, upright.

    Raises `InputError` where it is missing, damaged, too large or of no known kind.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path} is a folder: give an image file")
    if not path.exists():
        raise InputError(f"{path}: there is no such file")
    if not path.is_file():
        raise InputError(f"{path} is not a regular file: give an image file")
    try:
        limits.check_stored(path, path.stat().st_size)
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if not data:
        raise InputError(f"{path}: the file is empty")
    kind, reader = next(
        ((kind, reader) for magic, kind, reader in _READERS if data.startswith(magic)), (None, None)
    )
    if reader is None:
        raise InputError(
            f"{path}: not an image of a known kind (PNG, JPEG, TIFF, EXR, HDR, BMP, PPM, PGM, NPY): convert it to PNG"
        )
    try:
        with suppress_native_output():
            raster = reader(data, path, limits)
    except InputError:
        raise
    except _DECODING_ERRORS as error:
        raise InputError(
            f"{path}: the {kind} file is damaged, incomplete or of an unusual kind: save it again as a plain PNG"
        ) from error
    values = np.ascontiguousarray(raster.values)
    return replace(raster, values=values, sha256=hashlib.sha256(data).hexdigest())


def recoded(raster: Raster, transfer: str, image: np.ndarray, changed: np.ndarray) -> Raster:
    """`raster` with `image` (H, W, 3), linear, coded as the file is ("srgb" or "linear") where
    `changed` (H, W); other values stay bit by bit. Codes are rounded and cut to the coding's range;
    a grey file gets three channels if its new pixels have colour.
    """
    values = raster.values
    if values.shape[2] == 1 and (np.ptp(image[changed], axis=-1) > 0).any():
        values = _as_rgb(values)
    coded = image[changed][:, : values.shape[2]]
    coded = linear_to_srgb(coded) if transfer == "srgb" else coded
    result = values.copy()
    result[changed] = coded if raster.peak is None else np.rint(np.clip(coded, 0, 1) * raster.peak)
    return replace(raster, values=result)


def write_png(path: Path, raster: Raster) -> None:
    """Writes integer codes and their alpha as a PNG of 8 or 16 bits, as they are.

    Raises `OSError` when it cannot be written.
    """
    assert raster.peak is not None, "floats have no codes"
    kind = raster.values.dtype
    planes = (
        _as_rgb(raster.values)[..., ::-1]
        if raster.alpha is not None or raster.values.shape[2] == 3
        else raster.values
    )
    if raster.alpha is not None:
        planes = np.concatenate(
            [planes, np.rint(raster.alpha * float(np.iinfo(kind).max)).astype(kind)[..., None]],
            axis=2,
        )
    done, data = cv2.imencode(".png", np.ascontiguousarray(planes))
    if not done:
        raise OSError(errno.EIO, "the PNG could not be coded")
    path.write_bytes(data.tobytes())


def _check_size(path: Path, limits: Limits, width: int, height: int) -> None:
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


def _raster_of_codes(
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


def _orientation(image: Image.Image) -> int:
    try:
        return int(image.getexif().get(_ORIENTATION_TAG, 1))
    except (OSError, SyntaxError, ValueError, TypeError, KeyError, struct.error):
        return (
            1  # metadata that cannot be read says nothing about rotation; the pixels are still good
        )


def _raster_of_pillow(
    image: Image.Image, path: Path, limits: Limits, oriented: bool = False
) -> Raster:
    """`oriented`: the decoder turns the image itself.

    Stricter than OpenCV: a file cut short raises OSError.
    """
    _check_size(path, limits, *image.size)
    if image.mode in ("CMYK", "LAB", "HSV"):
        raise InputError(
            f"{path}: its colours are {image.mode}, made for printing or editing: convert it to RGB, for example as a PNG"
        )
    orientation = 1 if oriented else _orientation(image)
    image.load()
    has_alpha = image.mode in ("LA", "La", "PA", "RGBA", "RGBa") or "transparency" in image.info
    mode = "RGBA" if has_alpha else "L" if image.mode in ("1", "L") else "RGB"
    if image.mode == "RGBa" or image.mode in (
        "1",
        "L",
        "LA",
        "PA",
        "P",
        "RGB",
        "RGBA",
        "RGBX",
        "YCbCr",
    ):
        return _raster_of_codes(np.asarray(image.convert(mode)), 255, orientation)
    raise InputError(
        f"{path}: pixels of kind {image.mode} are not read: convert it to an 8- or 16-bit PNG or an EXR"
    )


def _decode_opencv(data: bytes) -> np.ndarray:
    """(H, W) or (H, W, C) in RGB(A) order, bits and values as stored.

    Raises ValueError where OpenCV gives nothing.
    """
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("not decoded")
    if pixels.ndim == 2:
        return pixels
    return pixels[..., [2, 1, 0, 3][: pixels.shape[2]]]


def _read_png(data: bytes, path: Path, limits: Limits) -> Raster:
    """16 bits go through OpenCV, for Pillow would cut RGB to 8; each chunk's checksum is verified
    first, which decoders skip.
    """
    width, height, bits = struct.unpack(">IIB", data[16:25])
    _check_size(path, limits, width, height)
    plain = _plain_png(data)
    image = PngImagePlugin.PngImageFile(io.BytesIO(plain))
    if bits == 16:
        return _raster_of_codes(_decode_opencv(plain), 65535, _orientation(image))
    return _raster_of_pillow(image, path, limits)


def _plain_png(data: bytes) -> bytes:
    """The PNG with nothing but pixels, transparency and EXIF.

    Raises ValueError for a wrong checksum or a missing end.
    """
    kept, at = [data[:8]], 8
    while True:
        (length,) = struct.unpack(">I", data[at : at + 4])
        chunk = data[at : at + 12 + length]
        kind = chunk[4:8]
        if (
            len(chunk) < 12 + length
            or zlib.crc32(chunk[4:-4]) != struct.unpack(">I", chunk[-4:])[0]
        ):
            raise ValueError("a PNG chunk is damaged")
        if kind in (b"IHDR", b"PLTE", b"tRNS", b"eXIf", b"IDAT", b"IEND"):
            kept.append(chunk)
        if kind == b"IEND":
            return b"".join(kept)
        at += 12 + length


def _read_jpeg(data: bytes, path: Path, limits: Limits) -> Raster:
    return _raster_of_pillow(JpegImagePlugin.JpegImageFile(io.BytesIO(data)), path, limits)


def _read_bmp(data: bytes, path: Path, limits: Limits) -> Raster:
    return _raster_of_pillow(BmpImagePlugin.BmpImageFile(io.BytesIO(data)), path, limits)


def _read_pnm(data: bytes, path: Path, limits: Limits) -> Raster:
    gap = rb"(?:\s|#[^\n]*\n)+"
    header = re.match(rb"P([56])" + gap + rb"(\d+)" + gap + rb"(\d+)" + gap + rb"(\d+)\s", data)
    if header is None or int(header[4]) < 256:
        return _raster_of_pillow(PpmImagePlugin.PpmImageFile(io.BytesIO(data)), path, limits)
    width, height, peak = int(header[2]), int(header[3]), int(header[4])
    _check_size(path, limits, width, height)
    channels = 3 if header[1] == b"6" else 1
    codes = np.frombuffer(data, ">u2", width * height * channels, header.end()).astype(np.uint16)
    if peak > 65535 or codes.max() > peak:
        raise ValueError("codes above the stated maximum")
    return _raster_of_codes(codes.reshape(height, width, channels), peak)


# Number and default of BitsPerSample, SamplesPerPixel, PhotometricInterpretation, SampleFormat,
# ExtraSamples.
_TIFF_TAGS = ((258, 1), (277, 1), (262, -1), (339, 1), (338, 0))


def _read_tiff(data: bytes, path: Path, limits: Limits) -> Raster:
    """8 bits go through Pillow, 16 bits and floats through OpenCV; both apply the rotation flag
    themselves.
    """
    stream = io.BytesIO(data)
    tags = TiffImagePlugin.ImageFileDirectory_v2(
        stream.read(16 if data[2:3] == b"+" or data[3:4] == b"+" else 8)
    )
    stream.seek(tags.next)
    tags.load(stream)
    _check_size(path, limits, int(tags[256]), int(tags[257]))
    bits, samples, photometric, stores, extra = (
        int(np.ravel(tags.get(tag, n))[0]) for tag, n in _TIFF_TAGS
    )
    if photometric == 5:
        raise InputError(
            f"{path}: its colours are CMYK, made for printing: convert it to RGB, for example as a PNG"
        )
    if bits <= 8:
        return _raster_of_pillow(
            TiffImagePlugin.TiffImageFile(io.BytesIO(data)), path, limits, oriented=True
        )
    pixels = _decode_opencv(data)
    fits = (pixels.dtype == np.uint16 and stores == 1 and bits == 16) or pixels.dtype.kind == "f"
    if (
        not fits
        or photometric not in (1, 2, 32844, 32845)
        or samples != (pixels.shape[2] if pixels.ndim == 3 else 1)
    ):
        raise InputError(
            f"{path}: a TIFF with {samples} channels of {bits} bits of this kind is not read: save it as a 16-bit RGB PNG"
        )
    if pixels.dtype.kind == "f":
        pixels = pixels.astype(np.float32)
    return _raster_of_codes(pixels, 65535, premultiplied=extra == 1)


def _read_hdr(data: bytes, path: Path, limits: Limits) -> Raster:
    size = re.search(rb"\n-Y (\d+) \+X (\d+)\n", data)
    if size is None:
        raise ValueError("no upright resolution line")
    _check_size(path, limits, int(size[2]), int(size[1]))
    return _raster_of_codes(_decode_opencv(data), 0)


def _read_exr(data: bytes, path: Path, limits: Limits) -> Raster:
    """The RGB or Y channels, and A, which EXR colours are premultiplied by; the frame is the
    display window, black without data.
    """
    for claimed in check_exr(data, path, limits):
        for window in (claimed.data, claimed.display):
            _check_size(path, limits, *size_of(window))
    with memory_file(data) as place:
        parts = OpenEXR.File(str(place), separate_channels=True).parts
    if not parts:
        raise ValueError("the pixels cannot be read")
    layer = "{0}.{1}" if len(parts) > 1 else "{1}"
    found = {
        layer.format(part.name(), name): (channel.pixels, part.header)
        for part in parts
        for name, channel in part.channels.items()
    }
    names = _exr_channels(list(found), path)
    if len({found[name][0].shape for name in names}) > 1:
        raise InputError(f"{path}: its channels differ in size: save it as a plain RGB EXR")
    planes = [_in_display_window(*found[name]) for name in names]
    if len(planes) == 2:
        planes = [planes[0]] * 3 + planes[1:]
    depth = 8 * found[names[0]][0].dtype.itemsize
    return replace(
        _raster_of_codes(np.stack(planes, axis=2), 0, premultiplied=True), bit_depth=depth
    )


def _exr_channels(names: list[str], path: Path) -> list[str]:
    """R, G, B or Y, then A where there is one, of the layer without a name or of the only layer
    that has them.
    """
    layers: dict[str, dict[str, str]] = {}
    for name in names:
        layer, _, channel = name.rpartition(".")
        layers.setdefault(layer, {})[channel.upper()] = name
    if len(names) == 1:
        return names
    for wanted in ("RGB", "Y"):
        fitting = [
            layer
            for layer, channels in layers.items()
            if set(wanted) <= channels.keys() and "RY" not in channels
        ]
        chosen = "" if "" in fitting else fitting[0] if len(fitting) == 1 else None
        if chosen is not None:
            return [layers[chosen][c] for c in wanted + "A" if c in layers[chosen]]
        if fitting:
            raise InputError(
                f"{path}: which layer is the photo: {', '.join(fitting)}? Save that one as an EXR of its own"
            )
    raise InputError(
        f"{path}: has no R, G, B and no Y channels but {', '.join(names[:8])}: save it as a plain RGB EXR"
    )


def _in_display_window(pixels: np.ndarray, header: dict[str, Any]) -> np.ndarray:
    (low, _), (frame_low, frame_high) = header["dataWindow"], header["displayWindow"]
    (x, y), (width, height) = low - frame_low, frame_high - frame_low + 1
    left, right = max(x, 0), max(min(x + pixels.shape[1], width), 0)
    top, bottom = max(y, 0), max(min(y + pixels.shape[0], height), 0)
    frame = np.zeros((height, width), np.float32)
    if right > left and bottom > top:
        frame[top:bottom, left:right] = pixels[top - y : bottom - y, left - x : right - x]
    return frame


def _read_npy(data: bytes, path: Path, limits: Limits) -> Raster:
    """(H, W), (H, W, 1), (H, W, 3) or (H, W, 4), alpha last and not multiplied in.

    The header alone says how much is to come.
    """
    shape, by_columns, kind, start = array_header(data)
    if len(shape) not in (2, 3) or shape[2:] not in ((), (1,), (3,), (4,)):
        raise InputError(
            f"{path}: an array of shape {shape}: a photo is (H, W, 3), or (H, W, 4) with alpha, a mask (H, W)"
        )
    if kind.kind not in "fbu" or kind.itemsize > 8 or (kind.kind == "u" and kind.itemsize > 2):
        raise InputError(
            f"{path}: values of type {kind}: give floats of linear light, codes of 8 or 16 bits (uint8, uint16), or bool"
        )
    _check_size(path, limits, shape[1], shape[0])
    stored = np.frombuffer(data, kind, math.prod(shape), start).reshape(
        shape, order="F" if by_columns else "C"
    )
    if kind.kind == "f":
        return _raster_of_codes(stored.astype(np.float32), 0)
    stored = stored.astype(f"u{kind.itemsize}") * np.uint8(255 if kind.kind == "b" else 1)
    return _raster_of_codes(stored, np.iinfo(stored.dtype).max)


_READERS: tuple[tuple[bytes, str, Callable[[bytes, Path, Limits], Raster]], ...] = (
    (b"\x89PNG\r\n\x1a\n", "PNG", _read_png),
    (b"\xff\xd8\xff", "JPEG", _read_jpeg),
    (b"II*\0", "TIFF", _read_tiff),
    (b"MM\0*", "TIFF", _read_tiff),
    (b"II+\0", "TIFF", _read_tiff),
    (b"MM\0+", "TIFF", _read_tiff),
    (b"\x76\x2f\x31\x01", "EXR", _read_exr),
    (b"#?RADIANCE", "HDR", _read_hdr),
    (b"#?RGBE", "HDR", _read_hdr),
    (b"BM", "BMP", _read_bmp),
    (b"\x93NUMPY", "NPY", _read_npy),
    *((b"P%d" % n, "PPM", _read_pnm) for n in range(1, 7)),
)
