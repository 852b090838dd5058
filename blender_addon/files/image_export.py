"""Images of Blender as files that the worker reads, without losing bits and without holding the
window up.

Problem: an image datablock may be a file, packed, generated, painted and never saved; 8 bits or
float; of any colour space. The worker reads files. So an image that is just its file is handed over
as that file, which keeps 16 bits and what the file says of its coding; all others leave Blender as
pixels. Equation: byte images hold codes q / 255, handed over as an array of the codes q (a clipped
pixel stays known as clipped). Float images hold scene-linear light, multiplied by alpha unless that
is channel-packed or ignored: (r, g, b) = M (r', g', b') / alpha, with M from Blender's working
space to linear Rec.709, handed over as an array of float32. Limits: byte images in a colour space
other than sRGB and linear Rec.709 are refused (Non-Color counts as linear). Blender does not turn
photos by their rotation flag and the worker does: files that have one are handed over as pixels, so
that masks painted on them fit.
"""

import mmap
import struct
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import bpy
import mathutils
import numpy as np

from isc_core.errors import InputError

MOST_PIXELS = 100_000_000
LEAST_SIDE = 8
_SUFFIXES = {
    b"\x89PNG": ".png",
    b"\xff\xd8\xff": ".jpg",
    b"II*\0": ".tif",
    b"MM\0*": ".tif",
    b"v/1\x01": ".exr",
    b"#?": ".hdr",
    b"BM": ".bmp",
}
_HEAD = 1 << 18  # cameras write the rotation flag near the start
_ORIENTATION = 0x0112
_LINEAR = ("Linear Rec.709", "Linear")
_NO_PICTURE = {
    "MOVIE": "is a movie: save one frame of it as an image and choose that",
    "SEQUENCE": "is an image sequence: open one of its files as a single image",
    "TILED": "has several tiles (UDIM): open one of its tiles as a single image",
}

T = TypeVar("T")
Steps = Generator[None, None, T]


@dataclass(frozen=True)
class Picture:
    """How an image leaves Blender, known before any of its pixels are touched.

    `name`: of the datablock, with its library. `path`: the file that shows exactly what Blender
    shows, or None. `data`: the packed bytes of such a file, or None. `transfer`: "srgb" or
    "linear", how the file's or the pixels' numbers are coded. `size`: (width, height), (0, 0) where
    the file speaks for itself. `channels`: of the pixels. `is_float`: light, not codes.
    `associated`: light multiplied by alpha. `covers`: alpha says what belongs to the object.
    `to_rec709`: (3, 3), from Blender's working space.
    """

    name: str
    path: Path | None = None
    data: bytes | None = None
    transfer: str = "srgb"
    size: tuple[int, int] = (0, 0)
    channels: int = 4
    is_float: bool = False
    associated: bool = False
    covers: bool = True
    to_rec709: np.ndarray | None = None


def examine(image: Any, *, as_pixels: bool = False) -> Picture:
    """How `image` can be handed over;

    `as_pixels`: not as its file. Raises `InputError` for one that is no picture or has no data.
    """
    if image.source in _NO_PICTURE:
        raise InputError(f"the image {image.name} {_NO_PICTURE[image.source]}")
    if image.type == "RENDER_RESULT":
        raise InputError(
            "the render result cannot be read: save it (Image, Save As) and open the file"
        )
    if not as_pixels and (unchanged := _as_file(image)) is not None:
        return unchanged
    size = (int(image.size[0]), int(image.size[1]))
    if 0 in size or len(image.pixels) != size[0] * size[1] * image.channels:
        raise InputError(_why_empty(image))
    if min(size) < LEAST_SIDE:
        raise InputError(
            f"the image {image.name} is {size[0]} x {size[1]} pixels: choose a larger one"
        )
    if size[0] * size[1] > MOST_PIXELS:
        raise InputError(
            f"the image {image.name} has {size[0] * size[1] / 1e6:.0f} million pixels: scale it down (Image, Resize)"
        )
    transfer = "linear" if image.is_float else _coding(image)
    if not transfer:
        space = image.colorspace_settings.name
        raise InputError(
            f"the image {image.name} has the colour space {space}: choose sRGB, Linear Rec.709 or Non-Color for it"
        )
    straight = image.alpha_mode in {"STRAIGHT", "PREMUL"}
    return Picture(
        image.name_full,
        None,
        None,
        transfer,
        size,
        int(image.channels),
        bool(image.is_float),
        image.is_float and straight,
        straight,
        working_to_rec709(),
    )


def hand_over(picture: Picture, stem: Path) -> Steps[Path]:
    """Writes the picture as a file named `stem` with a suffix that fits, in steps of a few
    milliseconds; returns the file's path.

    Each `next()` is one step. Raises `InputError` where the image has gone or the file cannot be
    written.
    """
    if picture.path is not None:
        return picture.path
    if picture.data is not None:
        data = picture.data
        path = stem.with_suffix(_suffix(data))
        yield from in_background(lambda: _write(path, data))
        return path
    pixels = yield from _taken(picture)
    return (
        yield from in_background(lambda: _write_picture(picture, pixels, stem.with_suffix(".npy")))
    )


def hand_over_mask(
    picture: Picture, stem: Path, size: tuple[int, int] | None = None
) -> Steps[Path]:
    """The same for a mask:

    (H, W) bool as `.npy`, or its own file. `size`: (width, height) to scale it to; needs pixels
    then.
    """
    if picture.path is not None or picture.data is not None:
        return (yield from hand_over(picture, stem))
    pixels = yield from _taken(picture)
    return (yield from in_background(lambda: _write_mask(picture, pixels, size, stem)))


def in_background(work: Callable[[], T]) -> Steps[T]:
    """Does `work`, which must not touch Blender, in a thread; yields until it is done.

    Raises what it raises.
    """
    pool = ThreadPoolExecutor(1)
    try:
        future = pool.submit(work)
        while not future.done():
            yield
        return future.result()
    except MemoryError as error:
        raise InputError(
            "there is not enough memory for this image: scale it down (Image, Resize)"
        ) from error
    finally:
        pool.shutdown(wait=False)


# --- what Blender shows ---------------------------------------------------------------------------


def _as_file(image: Any) -> Picture | None:
    """The image as its file, packed or on disk, if the worker would read from it what Blender
    shows; else None.
    """
    transfer = _coding(image)
    if image.source != "FILE" or image.is_dirty or not transfer:
        return None
    if image.packed_file is not None:
        data = bytes(image.packed_file.data)
        return (
            Picture(image.name_full, None, data, transfer)
            if _speaks_for_itself(data, image.alpha_mode)
            else None
        )
    path = Path(image.filepath_from_user())
    try:
        with (
            path.open("rb") as file,
            mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
        ):
            fits = _speaks_for_itself(content[:_HEAD], image.alpha_mode)
    except (
        OSError,
        ValueError,
    ):  # a missing, forbidden or empty file: what Blender still holds of it counts
        return None
    return Picture(image.name_full, path, None, transfer) if fits else None


def _coding(image: Any) -> str:
    """How the numbers of an image's file are coded: "srgb", "linear", or "" for what the worker
    does not know.
    """
    space = image.colorspace_settings
    if space.name == "sRGB":
        return "srgb"
    return "linear" if space.is_data or space.name in _LINEAR else ""


def _speaks_for_itself(head: bytes, alpha_mode: str) -> bool:
    """Whether the worker knows files that begin so, reads their alpha as Blender was told to, and
    does not turn them.
    """
    suffix = _suffix(head)
    usual = "PREMUL" if suffix == ".exr" else "STRAIGHT"
    return suffix != "" and alpha_mode == usual and orientation(head) == 1


def _suffix(head: bytes) -> str:
    return next((suffix for magic, suffix in _SUFFIXES.items() if head[:4].startswith(magic)), "")


def orientation(head: bytes) -> int:
    """The rotation flag of a JPEG, PNG or TIFF file that begins with `head`: 1 (upright, or not
    said) to 8.
    """
    marks = ((b"Exif\0\0", 6), (b"eXIf", 4))
    start = (
        0
        if _suffix(head) == ".tif"
        else next((at + skip for mark, skip in marks if (at := head.find(mark, 0, _HEAD)) >= 0), -1)
    )
    if start < 0:
        return 1
    order = "<" if head[start : start + 2] == b"II" else ">"
    try:
        (first,) = struct.unpack_from(f"{order}I", head, start + 4)
        (count,) = struct.unpack_from(f"{order}H", head, start + first)
        for entry in range(count):
            tag, _, _, value = struct.unpack_from(
                f"{order}HHIH", head, start + first + 2 + 12 * entry
            )
            if tag == _ORIENTATION:
                return int(value)
    except struct.error:
        # A TIFF may keep its table behind the pixels: not known means not trusted.
        return 0
    return 1


def _why_empty(image: Any) -> str:
    if image.source == "FILE" and not image.packed_file:
        return f"the image {image.name} has no data: its file {image.filepath_from_user()} is missing or damaged; open it again"
    return f"the image {image.name} has no data: open a file or choose another image"


def working_to_rec709() -> np.ndarray:
    """(3, 3) float32: from Blender's scene-linear working space, which may be wider, to linear
    Rec.709.
    """
    axes = [mathutils.Color(axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    if not hasattr(
        axes[0], "from_scene_linear_to_rec709_linear"
    ):  # before 5.0 it is linear Rec.709
        return np.eye(3, dtype=np.float32)
    return np.array(
        [tuple(axis.from_scene_linear_to_rec709_linear()) for axis in axes], np.float32
    ).T


# --- pixels ---------------------------------------------------------------------------------------


def _taken(picture: Picture) -> Steps[np.ndarray]:
    """(H, W, channels) float32, row 0 at the top, as Blender holds them.

    Only the copying itself is done where the window waits.
    """
    count = picture.size[0] * picture.size[1] * picture.channels
    # Getting fresh memory from the system takes far longer than copying into it: it is touched in
    # the background.
    buffer = yield from in_background(lambda: np.full(count, 0, np.float32))
    image = next((image for image in bpy.data.images if image.name_full == picture.name), None)
    if image is None or len(image.pixels) != count:
        raise InputError(f"the image {picture.name} was removed or resized meanwhile: start again")
    image.pixels.foreach_get(buffer)
    return buffer.reshape(picture.size[1], picture.size[0], picture.channels)[::-1]


def _write_picture(picture: Picture, pixels: np.ndarray, path: Path) -> Path:
    _write(path, light(picture, pixels) if picture.is_float else codes(picture, pixels))
    return path


def codes(picture: Picture, pixels: np.ndarray) -> np.ndarray:
    """(H, W, 3), or (H, W, 4) with alpha where that says anything: the uint8 codes of a byte
    image's pixels (H, W, 4).
    """
    stored = np.rint(255 * pixels).astype(np.uint8)
    return (
        stored
        if picture.covers and (stored[..., 3] < 255).any()
        else np.ascontiguousarray(stored[..., :3])
    )


def light(picture: Picture, pixels: np.ndarray) -> np.ndarray:
    """(H, W, 3), or (H, W, 4) with straight alpha where that says anything: linear Rec.709 of a
    float image's pixels (H, W, channels).
    """
    color = pixels[..., :3] if picture.channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    alpha = pixels[..., 3:4] if picture.channels == 4 else np.ones_like(pixels[..., :1])
    if picture.associated:
        color = color / np.where(alpha > 0, alpha, 1)
    if picture.to_rec709 is not None and not np.allclose(picture.to_rec709, np.eye(3), atol=1e-6):
        color = color @ picture.to_rec709.T
    if picture.covers and (alpha < 1).any():
        return np.concatenate([color, alpha], axis=2).astype(np.float32)
    return np.ascontiguousarray(color, np.float32)


def _write_mask(
    picture: Picture, pixels: np.ndarray, size: tuple[int, int] | None, stem: Path
) -> Path:
    mask = mask_of(picture, pixels)
    path = stem.with_suffix(".npy")
    _write(path, mask if size is None else scaled(mask, size))
    return path


def mask_of(picture: Picture, pixels: np.ndarray) -> np.ndarray:
    """(H, W) bool of pixels (H, W, channels): alpha from one half on where it is not opaque, else
    above half of the largest value.

    Raises `InputError` if that is empty.
    """
    if picture.channels == 4 and picture.covers and (pixels[..., 3] < 1).any():
        mask = pixels[..., 3] >= 0.5
    else:
        brightest = np.nan_to_num(pixels[..., : min(picture.channels, 3)].max(-1), posinf=0.0)
        mask = brightest > 0.5 * max(float(brightest.max()), 0.0)
    if not mask.any():
        raise InputError(f"the mask {picture.name} is empty: paint the object white on black")
    return mask


def scaled(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """An (H, W) mask brought to (width, height) pixels: each takes what lies under its centre."""
    rows, columns = (
        np.minimum((np.arange(new) + 0.5) * old / new, old - 1).astype(int)
        for new, old in zip(size[::-1], mask.shape, strict=True)
    )
    return mask[np.ix_(rows, columns)]


# --- files ----------------------------------------------------------------------------------------


def _write(path: Path, content: bytes | np.ndarray) -> None:
    try:
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            np.save(path, content, allow_pickle=False)
    except OSError as error:
        raise InputError(
            f"cannot write {path}: {error.strerror or error}; choose another cache folder in the preferences"
        ) from error
