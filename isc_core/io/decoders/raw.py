"""Camera raw files (DNG, CR2, CR3, NEF, ARW and others), developed by LibRaw through rawpy.

The picture is 16-bit linear Rec.709: black level subtracted, white balance of the camera, no
automatic brightness, 1 at the saturation of the sensor. A raw file is detected from its content:
many are TIFF files, in which the directory of the raw pixels has the photometric interpretation of
a colour filter array or of linear raw, or the tag `DNGVersion`.

Citation: Adobe, "Digital Negative (DNG) Specification" 1.7.1 (2023); K. Hirakawa and T. W. Parks
(2005), "Adaptive homogeneity-directed demosaicing algorithm", doi:10.1109/TIP.2004.838691, LibRaw's
default.

Limits: lens corrections, local tone curves and opcodes of a DNG are not applied. Where a pixel is
saturated, its neighbours are marked, too, since demosaicing uses it for their colours.
"""

import io
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ...errors import InputError
from ...extras import install_command
from ..limits import Limits
from ..reading_notes import ReadingNote, ReadingNoteKind
from .colour.space import LINEAR, ColourSpace
from .exif import with_focal_length
from .raster import Raster, check_size, raster_of_codes

CAMERA_RAW = "camera raw"
_SIGNATURES = (
    (0, b"FUJIFILMCCD-RAW"),
    (0, b"IIRO"),
    (0, b"IIRS"),
    (0, b"MMOR"),
    (0, b"IIU\0"),
    (0, b"\0MRM"),
    (0, b"FOVb"),
    (4, b"ftypcrx "),
    (0, b"II\x1a\0\0\0HEAPCCDR"),
    (0, b"II*\0\x10\0\0\0CR\x02"),
)
_PHOTOMETRIC, _SUB_DIRECTORIES, _DNG_VERSION = 262, 330, 50706
_RAW_PHOTOMETRIC = (32803, 34892)  # colour filter array, linear raw
_MOST_DIRECTORIES, _MOST_ENTRIES = 16, 500


def is_raw(data: bytes) -> bool:
    """Return whether a file is a camera raw file.

    Parameters
    ----------
    data : bytes
        The whole file.

    Returns
    -------
    bool
    """
    if any(data.startswith(mark, at) for at, mark in _SIGNATURES):
        return True
    return data[:4] in (b"II*\0", b"MM\0*") and any(
        _DNG_VERSION in tags or tags.get(_PHOTOMETRIC, (0,))[0] in _RAW_PHOTOMETRIC
        for tags in _directories(data)
    )


def read_raw(data: bytes, path: Path, limits: Limits) -> Raster:
    """Develop a camera raw file.

    Parameters
    ----------
    data : bytes
        The whole file.
    path : Path
        Prefix of the error message.
    limits : Limits

    Returns
    -------
    Raster
        Linear; `bit_depth` is the sensor's.

    Raises
    ------
    InputError
        If rawpy is missing, LibRaw does not know the camera, or the size is not supported.
    ValueError
        If the file is damaged.
    """
    rawpy = _library(path)
    try:
        with rawpy.imread(io.BytesIO(data)) as raw:
            sizes = raw.sizes
            limits.check_pixels(path, sizes.raw_width, sizes.raw_height)
            check_size(path, limits, sizes.iwidth, sizes.iheight)
            saturated = _saturated(raw)
            known = raw.num_colors < 3 or np.any(raw.color_matrix) or np.any(raw.rgb_xyz_matrix)
            bits = int(raw.white_level).bit_length()
            codes = raw.postprocess(
                use_camera_wb=True,
                no_auto_bright=True,
                adjust_maximum_thr=0.0,
                gamma=(1, 1),
                output_bps=16,
                output_color=rawpy.ColorSpace.sRGB,
            )
    except rawpy.LibRawFileUnsupportedError as error:
        raise InputError(
            f"{path}: a raw file that is damaged, or of a camera that LibRaw "
            f"{'.'.join(map(str, rawpy.libraw_version))} does not know: convert it to DNG, or "
            "export it as a 16-bit TIFF"
        ) from error
    except (rawpy.LibRawUnsufficientMemoryError, rawpy.LibRawTooBigError) as error:
        raise MemoryError(str(error)) from error
    except rawpy.LibRawError as error:
        raise ValueError("a damaged raw file") from error
    notes = () if known else (ReadingNote(ReadingNoteKind.UNKNOWN_CAMERA_COLOURS),)
    raster = raster_of_codes(codes, 65535, space=ColourSpace(CAMERA_RAW, (LINEAR,)), notes=notes)
    peak = (codes == 65535).any(axis=2)
    fits = saturated is not None and saturated.shape == peak.shape
    saturated = peak | saturated if fits else peak
    return with_focal_length(replace(raster, bit_depth=min(bits, 16), saturated=saturated), data)


def _library(path: Path) -> ModuleType:
    try:
        import rawpy
    except ImportError as error:
        raise InputError(
            f"{path}: camera raw needs rawpy: install it with `{install_command('raw')}`, or "
            "export the photo as a 16-bit TIFF"
        ) from error
    return rawpy


def _saturated(raw: Any) -> np.ndarray | None:
    """Where the developed picture (H, W) depends on a saturated pixel of the sensor; None without
    the sensor's pixels.
    """
    sensor = raw.raw_image_visible
    if sensor is None:
        return None
    from scipy.ndimage import maximum_filter  # few photos are raw

    levels = [raw.white_level, *(raw.camera_white_level_per_channel or ())]
    full = sensor >= min(level for level in levels if level > 0)
    if full.ndim == 3:
        full = full.any(axis=2)
    else:
        bayer = raw.raw_pattern is None or len(raw.raw_pattern) == 2
        full = maximum_filter(full, 3 if bayer else 5)
    # LibRaw's orientation: the bits are columns reversed, rows reversed, transposed.
    flip = raw.sizes.flip
    full = full[:: -1 if flip & 2 else 1, :: -1 if flip & 1 else 1]
    return full.T if flip & 4 else full


def _directories(data: bytes) -> Iterator[dict[int, tuple[int, ...]]]:
    """The numeric tags of a TIFF's directories and sub-directories."""
    order = "<" if data[:2] == b"II" else ">"
    try:
        waiting = [struct.unpack_from(f"{order}I", data, 4)[0]]
        for _ in range(_MOST_DIRECTORIES):
            if not waiting:
                return
            start = waiting.pop(0)
            (count,) = struct.unpack_from(f"{order}H", data, start)
            entries = range(start + 2, start + 2 + 12 * min(count, _MOST_ENTRIES), 12)
            tags = dict(_entry(data, order, at) for at in entries)
            yield tags
            following = struct.unpack_from(f"{order}I", data, start + 2 + 12 * count)
            waiting += [n for n in (*tags.get(_SUB_DIRECTORIES, ()), *following) if n]
    except struct.error:  # truncated: the tags found so far are used
        return


def _entry(data: bytes, order: str, at: int) -> tuple[int, tuple[int, ...]]:
    """Tag and numbers of a directory's entry; only sub-directories have several relevant ones."""
    tag, kind, count = struct.unpack_from(f"{order}HHI", data, at)
    if tag == _SUB_DIRECTORIES and 1 < count <= _MOST_DIRECTORIES:
        (start,) = struct.unpack_from(f"{order}I", data, at + 8)
        return tag, struct.unpack_from(f"{order}{count}I", data, start)
    return tag, struct.unpack_from(f"{order}{'H' if kind == 3 else 'I'}", data, at + 8)
