"""Reading a photo and its mask as linear light.

Problem: files store codes (8 or 16 bits, mostly sRGB) or floats, in various colour spaces; all
other packages use linear Rec.709 light with a mask.

Limits: see `transfer` for colour spaces and `io.decoders` for file formats.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..imaging.channels import largest, smallest
from ..imaging.row_blocks import row_blocks
from ..imaging.srgb import srgb_to_linear
from ..io.decoders import Raster, read_raster
from ..io.decoders.raster import as_rgb
from ..io.limits import DEFAULT_LIMITS, Limits
from ..io.memory import READING_BYTES_PER_PIXEL, enough_memory
from ..io.reading_notes import ReadingNote, ReadingNoteKind
from .camera import Camera
from .decontamination import estimate_foreground
from .found_mask import FoundMask, MaskFinder
from .masks import check_mask, find_mask, mask_of, opaque_part, soft_cover
from .names import WholeFrame
from .photo import Photo, PhotoSource
from .primaries import to_rec709
from .soft_rim import soft_rim
from .transfer import PROFILE, resolve_transfer, to_linear
from .white import limit_to_white

FLOAT_STEP = 2.0**-14
_MOST_OUTSIDE = 0.01  # of the object's pixels: below it there is no note
_CHUNK = 1 << 16  # pixels compared at a time
_DEFECTIVE = 1e9  # times the median light of the object: brighter pixels are defective


def read_photo(
    path: str | Path,
    mask_path: str | Path | None = None,
    transfer: str = "auto",
    *,
    whole_frame: WholeFrame = WholeFrame.NEVER,
    limits: Limits = DEFAULT_LIMITS,
    finder: MaskFinder | None = None,
) -> Photo:
    """Read a photo at full size.

    Formats: PNG, JPEG, TIFF, HEIC (with the extra `heic`), AVIF, camera raw (with the extra `raw`),
    EXR, Radiance HDR, BMP, PPM, PGM and NumPy's .npy (its integers are codes), recognised by their
    content. Colours are converted from the colour space that the file states.

    The mask is `mask_path` (inside: above half of its largest value, or its alpha channel where
    that is not opaque); else the photo's alpha channel (>= 0.5) where that leaves out a thousandth
    of the photo or more; else, on a black border (at most 2/255 in sRGB), the pixels that are not
    black, with holes filled and parts smaller than 1 % of the largest dropped.

    Parameters
    ----------
    path : str or Path
    mask_path : str or Path, optional
    transfer : {"auto", "srgb", "linear"}
        "auto": the curve that the file states; without one, floats are linear, all others sRGB.
    whole_frame : WholeFrame
        Whether all pixels are used where no mask is given.
    limits : Limits
        Checked with the header, before the file is decoded.
    finder : MaskFinder, optional
        Finds the object where there is no mask, alpha channel or black border
        (`isc_core.masking`).

    Returns
    -------
    Photo

    Raises
    ------
    InputError
        If anything cannot be used; the message names the remedy.
    """
    raster = read_raster(path, limits)
    mask = None if mask_path is None else read_raster(mask_path, limits)
    return photo_from_raster(
        raster,
        str(path),
        mask,
        str(mask_path),
        transfer=transfer,
        whole_frame=whole_frame,
        finder=finder,
    )


def photo_from_raster(
    raster: Raster,
    name: str,
    mask_raster: Raster | None = None,
    mask_name: str = "",
    *,
    transfer: str = "auto",
    whole_frame: WholeFrame = WholeFrame.NEVER,
    finder: MaskFinder | None = None,
) -> Photo:
    """Make a photo of decoded files.

    Parameters
    ----------
    raster : Raster
        The photo.
    name : str
        Prefix of the error messages.
    mask_raster : Raster, optional
        The mask.
    mask_name : str
        Prefix of the error messages about it.
    transfer : {"auto", "srgb", "linear"}
    whole_frame : WholeFrame
    finder : MaskFinder, optional
        As for `read_photo`.

    Returns
    -------
    Photo

    Raises
    ------
    InputError
        If anything cannot be used; the message names the remedy.
    """
    height, width = raster.values.shape[:2]
    with enough_memory(
        f"{name}: {width} x {height} pixels",
        READING_BYTES_PER_PIXEL * width * height,
        "reduce the image",
    ):
        return _photo(raster, name, mask_raster, mask_name, transfer, whole_frame, finder)


def _photo(
    raster: Raster,
    name: str,
    mask_raster: Raster | None,
    mask_name: str,
    transfer: str,
    whole_frame: WholeFrame,
    finder: MaskFinder | None,
) -> Photo:
    used = resolve_transfer(transfer, raster)
    _check_not_constant(raster.values, f"{name}: every pixel")
    linear = to_linear(raster, used)
    if mask_raster is None:
        seen, mask_from = find_mask(name, raster, linear, whole_frame, finder)
    else:
        seen, mask_from = mask_of(mask_raster, mask_name, raster), "file"
    found = seen if isinstance(seen, FoundMask) else None
    mask = seen.mask if isinstance(seen, FoundMask) else seen
    check_mask(mask, f"{name if mask_raster is None else mask_name}: the mask")
    _check_not_constant(raster.values, f"{name}: every pixel inside the mask", mask)
    cover = None if found is None else found.cover
    if mask_from in ("alpha", "file"):
        cover = soft_cover(raster if mask_raster is None else mask_raster, mask)
    mixed = found is not None or (
        mask_from == "file" and _is_soft(cover, mask) and not _has_soft_alpha(raster)
    )
    height, width = mask.shape
    lens = raster.focal_length
    cropped = lens is not None and lens.cropped
    light = as_rgb(linear if raster.peak is not None else _valid_light(linear, mask, name))
    code_value = _code_value(raster, used, linear, mask)
    notes = tuple(_notes(raster, used, linear, mask))
    clipped = _clipped(raster)
    if raster.peak is None:
        light, clipped = limit_to_white(light, mask)
        if clipped.any():
            notes += (ReadingNote(ReadingNoteKind.ABOVE_WHITE),)
    if mixed and cover is not None:
        # The light of a float file may be the raster itself.
        light = estimate_foreground(light, cover, in_place=raster.peak is not None)
    return Photo(
        image=light,
        mask=mask,
        code_value=code_value,
        clipped=clipped,
        original=PhotoSource(
            raster.sha256,
            (width, height),
            raster.bit_depth,
            used,
            mask_from,
            "" if raster.space is None else raster.space.name,
            notes,
            cropped,
            None if found is None else found.confidence,
        ),
        found=found,
        cover=cover,
        exposed=raster.peak is not None,
        camera=None if lens is None or cropped else Camera.of_frame(lens.pixels, (width, height)),
    )


def _has_soft_alpha(raster: Raster) -> bool:
    """Whether the colours of the object's rim are already its own, without the background's."""
    opaque = opaque_part(raster)
    return opaque is not None and soft_cover(raster, opaque) is not None


def _is_soft(cover: np.ndarray | None, mask: np.ndarray) -> bool:
    return cover is not None and soft_rim(cover, mask, own=False) is not None


def _clipped(raster: Raster) -> np.ndarray:
    if raster.saturated is not None:
        return raster.saturated
    if raster.peak is None:
        return np.zeros(raster.values.shape[:2], bool)
    return np.asarray(largest(raster.values) == raster.peak)


def _notes(
    raster: Raster, transfer: str, linear: np.ndarray, mask: np.ndarray
) -> Iterator[ReadingNote]:
    """Assumptions and omissions in reading the raster and its conversion to linear light."""
    unused = raster.space is not None and raster.space.is_table and transfer != PROFILE
    for note in raster.notes:
        table = note.kind is ReadingNoteKind.TABLE_PROFILE
        yield ReadingNote(ReadingNoteKind.UNUSED_PROFILE) if unused and table else note
    if raster.values.shape[2] == 3 and to_rec709(raster.space) is not None:
        # A channel that is black only in Rec.709 was clipped.
        outside = mask & (smallest(raster.values) > 0) & (smallest(linear) == 0)
        share = float(outside.sum() / mask.sum())
        if share > _MOST_OUTSIDE:
            yield ReadingNote(ReadingNoteKind.OUT_OF_GAMUT, share)


def read_linear(
    path: str | Path,
    transfer: str = "auto",
    limits: Limits = DEFAULT_LIMITS,
    *,
    finite: bool = False,
) -> np.ndarray:
    """Read a whole image as linear light, without a mask.

    Parameters
    ----------
    path : str or Path
    transfer : {"auto", "srgb", "linear"}
    limits : Limits
    finite : bool
        Raise `InputError` for values that are not finite.

    Returns
    -------
    (H, W, 3) float32 ndarray
        Linear Rec.709; values of float files that are negative or not finite become 0.

    Raises
    ------
    InputError
        As `read_photo`.
    """
    raster = read_raster(path, limits)
    if finite and not np.isfinite(raster.values).all():
        raise InputError(f"{path} has NaN or infinite values: clip it, or save it as 32-bit floats")
    linear = as_rgb(to_linear(raster, resolve_transfer(transfer, raster)))
    return np.where(np.isfinite(linear) & (linear > 0), linear, np.float32(0))


def _check_not_constant(values: np.ndarray, what: str, mask: np.ndarray | None = None) -> None:
    if problem := constant_problem(values, what, mask):
        raise InputError(problem)


def constant_problem(values: np.ndarray, what: str, mask: np.ndarray | None = None) -> str:
    """Say what is wrong with an image, or a part of it, that has one colour.

    Parameters
    ----------
    values : (H, W, C) ndarray
        Stored values.
    what : str
        Prefix of the message.
    mask : (H, W) bool ndarray, optional
        The part; by default all of it.

    Returns
    -------
    str
        The message; "" if there are several colours.
    """
    first = None
    for block in row_blocks(values.shape, pixels=_CHUNK):
        part = values[block.rows] if mask is None else values[block.rows][mask[block.rows]]
        part = part.reshape(-1, values.shape[-1])
        if first is None and len(part):
            first = part[0]
        if len(part) and (part != first).any():  # in most photos, already in the first block
            return ""
    black = first is None or not first.any()
    return (
        f"{what} is {'black' if black else 'the same'}: there is nothing to recover; use another "
        "photo"
    )


def _valid_light(linear: np.ndarray, mask: np.ndarray, path: str | Path) -> np.ndarray:
    """The image with zeros for invalid values outside the mask; raises `InputError` for those
    inside.
    """
    brightest, too_bright = (
        largest(linear),
        f"brighter than {_DEFECTIVE:g} times the object's median",
    )
    for bad, what in (
        (~np.isfinite(linear).all(axis=2), "NaN or infinite"),
        ((linear < 0).any(axis=2), "negative"),
        (brightest > _DEFECTIVE * _median_positive(brightest[mask]), too_bright),
    ):
        count = int((bad & mask).sum())
        if count:
            raise InputError(
                f"{path}: {count} pixels inside the mask are {what}: repair them, or exclude them "
                "from the mask"
            )
        if bad.any():
            linear = np.where(bad[..., None], np.float32(0), linear)
    return linear


def _median_positive(light: np.ndarray) -> float:
    """The median of the values (N,) above 0, infinite without any."""
    light = light[light > 0]
    return float(np.median(light)) if light.size else np.inf


def _code_value(raster: Raster, transfer: str, linear: np.ndarray, mask: np.ndarray) -> float:
    if raster.peak is None:
        light = largest(linear)[mask]
        return FLOAT_STEP * float(np.percentile(light, 99.9) or light.max())
    # Codes of fewer bits may be scaled to the range of more.
    step = max(1.0 / raster.peak, 1.0 / (2**raster.bit_depth - 1))
    return step if transfer == "linear" else float(srgb_to_linear(step))
