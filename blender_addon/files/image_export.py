"""Blender images written for the worker, without losing bits and without blocking the window.

Equation: byte images hold codes q / 255 and are written as an array of the codes q, so that a
clipped pixel is still recognised as clipped. Float images hold scene-linear values, multiplied by
alpha unless that is channel-packed or ignored: (r, g, b) = M (r', g', b') / alpha, with M from
Blender's working space to linear Rec.709. They are written as an array of float32.

Limits: Blender's own calls cannot run in a thread. Copying the pixels is the only step in which the
window waits.
"""

from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import bpy
import numpy as np

from isc_core.errors import InputError

from .image_source import ImageSource, suffix_of

_ROUNDED = 1e-4  # Blender 4.5 converts linear Rec.709 to itself with an error of 5e-6

T = TypeVar("T")
Steps = Generator[None, None, T]
"""Each `next()` is one step of a few milliseconds."""


def export_image(source: ImageSource, stem: Path) -> Steps[Path]:
    """Write an image as a file, in steps of a few milliseconds.

    Parameters
    ----------
    source : ImageSource
        The image; a source with a path is not copied.
    stem : Path
        Path of the new file without its suffix.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the image has been removed or the file cannot be written.
    """
    if source.path is not None:
        return source.path
    if source.data is not None:
        data = source.data
        path = stem.with_suffix(suffix_of(data))
        yield from run_in_thread(lambda: _write(path, data))
        return path
    pixels = yield from _copy_pixels(source)
    return (
        yield from run_in_thread(lambda: _write_image(source, pixels, stem.with_suffix(".npy")))
    )


def export_mask(
    source: ImageSource, stem: Path, size: tuple[int, int] | None = None
) -> Steps[Path]:
    """Write a mask as a file, in steps of a few milliseconds.

    Parameters
    ----------
    source : ImageSource
        The image; its file is used as it is.
    stem : Path
        Path of the new file without its suffix.
    size : tuple of int, optional
        Width and height to scale the mask to; requires a source with pixels.

    Returns
    -------
    Path
        The file: (H, W) bool as `.npy`, or the image's own file.

    Raises
    ------
    InputError
        If the mask is empty, has been removed, or cannot be written.
    """
    if source.path is not None or source.data is not None:
        return (yield from export_image(source, stem))
    pixels = yield from _copy_pixels(source)
    return (yield from run_in_thread(lambda: _write_mask(source, pixels, size, stem)))


def run_in_thread(work: Callable[[], T]) -> Steps[T]:
    """Run a function in a thread and yield until it is done.

    Parameters
    ----------
    work : callable
        The function; it must not use `bpy`.

    Returns
    -------
    T
        The function's return value.

    Raises
    ------
    InputError
        If memory runs out. Other exceptions of `work` pass unchanged.
    """
    pool = ThreadPoolExecutor(1)
    try:
        future = pool.submit(work)
        while not future.done():
            yield
        return future.result()
    except MemoryError as error:
        raise InputError(
            "there is not enough memory for this image: scale it down (Image > Resize)"
        ) from error
    finally:
        pool.shutdown(wait=False)


def to_codes(source: ImageSource, pixels: np.ndarray) -> np.ndarray:
    """Convert the pixels of a byte image to codes.

    Parameters
    ----------
    source : ImageSource
        The image.
    pixels : (H, W, 4) ndarray
        Values in [0, 1] as Blender returns them.

    Returns
    -------
    (H, W, 3) or (H, W, 4) ndarray of uint8
        Codes, with alpha where some pixel is transparent.
    """
    stored = np.rint(255 * pixels).astype(np.uint8)
    if source.uses_alpha and (stored[..., 3] < 255).any():
        return stored
    return np.ascontiguousarray(stored[..., :3])


def to_linear(source: ImageSource, pixels: np.ndarray) -> np.ndarray:
    """Convert the pixels of a float image to linear Rec.709.

    Parameters
    ----------
    source : ImageSource
        The image.
    pixels : (H, W, channels) ndarray
        Scene-linear values as Blender returns them.

    Returns
    -------
    (H, W, 3) or (H, W, 4) ndarray of float32
        Linear Rec.709, with straight alpha where some pixel is transparent.
    """
    color = pixels[..., :3] if source.channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    alpha = pixels[..., 3:4] if source.channels == 4 else np.ones_like(pixels[..., :1])
    if source.associated:
        color = color / np.where(alpha > 0, alpha, 1)
    if source.to_rec709 is not None and not np.allclose(source.to_rec709, np.eye(3), atol=_ROUNDED):
        color = color @ source.to_rec709.T
    if source.uses_alpha and (alpha < 1).any():
        return np.concatenate([color, alpha], axis=2).astype(np.float32)
    return np.ascontiguousarray(color, np.float32)


def to_mask(source: ImageSource, pixels: np.ndarray) -> np.ndarray:
    """Convert pixels to a mask.

    A pixel belongs to the object where alpha is at least one half; in an opaque image, where the
    largest channel exceeds half of its maximum.

    Parameters
    ----------
    source : ImageSource
        The image.
    pixels : (H, W, channels) ndarray
        Values as Blender returns them.

    Returns
    -------
    (H, W) ndarray of bool
        The mask.

    Raises
    ------
    InputError
        If the mask is empty.
    """
    if source.channels == 4 and source.uses_alpha and (pixels[..., 3] < 1).any():
        mask = pixels[..., 3] >= 0.5
    else:
        brightest = np.nan_to_num(pixels[..., : min(source.channels, 3)].max(-1), posinf=0.0)
        mask = brightest > 0.5 * max(float(brightest.max()), 0.0)
    if not mask.any():
        raise InputError(f"the mask {source.name} is empty: paint the object white on black")
    return mask


def resize_mask(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Resize a mask by nearest neighbour, sampled at pixel centres.

    Parameters
    ----------
    mask : (H, W) ndarray of bool
        The mask.
    size : tuple of int
        New width and height.

    Returns
    -------
    (height, width) ndarray of bool
        The resized mask.
    """
    rows, columns = (
        np.minimum((np.arange(new) + 0.5) * old / new, old - 1).astype(int)
        for new, old in zip(size[::-1], mask.shape, strict=True)
    )
    return mask[np.ix_(rows, columns)]


def _copy_pixels(source: ImageSource) -> Steps[np.ndarray]:
    """(H, W, channels) float32, row 0 at the top; the window waits for the copy alone."""
    count = source.size[0] * source.size[1] * source.channels
    # Getting new memory from the system takes far longer than copying into it: the pages are
    # touched in the thread.
    buffer = yield from run_in_thread(lambda: np.full(count, 0, np.float32))
    image = next((image for image in bpy.data.images if image.name_full == source.name), None)
    if image is None or len(image.pixels) != count:
        raise InputError(
            f"the image {source.name} was removed or resized in the meantime: start again"
        )
    image.pixels.foreach_get(buffer)
    return buffer.reshape(source.size[1], source.size[0], source.channels)[::-1]


def _write_image(source: ImageSource, pixels: np.ndarray, path: Path) -> Path:
    _write(path, to_linear(source, pixels) if source.is_float else to_codes(source, pixels))
    return path


def _write_mask(
    source: ImageSource, pixels: np.ndarray, size: tuple[int, int] | None, stem: Path
) -> Path:
    mask = to_mask(source, pixels)
    path = stem.with_suffix(".npy")
    _write(path, mask if size is None else resize_mask(mask, size))
    return path


def _write(path: Path, content: bytes | np.ndarray) -> None:
    try:
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            np.save(path, content, allow_pickle=False)
    except OSError as error:
        raise InputError(
            f"cannot write {path} ({error.strerror or error}): "
            "choose another cache folder in the preferences"
        ) from error
