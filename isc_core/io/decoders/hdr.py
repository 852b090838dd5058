"""Radiance HDR files: a mantissa for each channel and one exponent.

Equation: channel = code 2^(exponent - 136), and 0 where the exponent is 0. A row is either
uncompressed, four bytes per pixel, or begins with 2, 2 and its width, followed by its four channels
with run-length encoding: a count above 128 repeats the next byte count - 128 times, any other is
followed by as many literal bytes.

Citation: G. Ward, "Real Pixels", Graphics Gems II (1991), 80-83,
doi:10.1016/B978-0-08-050754-5.50025-6.

Limits: upright pictures in RGB; `EXPOSURE` is ignored, since only ratios of light matter. The older
run-length encoding of whole pixels is not supported.
"""

import re
from pathlib import Path

import numpy as np

from ..limits import Limits
from .raster import Raster, check_size, raster_of_codes

_HEADER_BYTES = 1 << 14
_SHORTEST, _LONGEST = 8, 0x7FFF  # rows of other lengths are uncompressed
_BIAS = 128 + 8


def read_hdr(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a Radiance HDR.

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

    Raises
    ------
    InputError
        If the size is not supported.
    ValueError
        If the first 16 KiB have no upright resolution line, the colours are not RGB, or the pixels
        are damaged or incomplete.
    """
    size = re.search(rb"\n-Y (\d+) \+X (\d+)\n", data[:_HEADER_BYTES])
    if size is None:
        raise ValueError("no upright resolution line")
    if b"\nFORMAT=32-bit_rle_rgbe" not in data[: size.start()]:
        raise ValueError("not in RGB")
    height, width = int(size[1]), int(size[2])
    check_size(path, limits, width, height)
    packed = data[size.end() : size.end() + 4] == b"\2\2" + width.to_bytes(2, "big")
    if packed and _SHORTEST <= width <= _LONGEST:
        pixels = _unpacked(data, size.end(), height, width)
    else:
        flat = np.frombuffer(data, np.uint8, 4 * height * width, size.end())
        pixels = flat.reshape(height, width, 4)
    return raster_of_codes(_light(pixels), 0)


def _unpacked(data: bytes, at: int, height: int, width: int) -> np.ndarray:
    """Pixels (height, width, 4) uint8 of run-length encoded rows from an offset."""
    pixels = np.empty((height, width, 4), np.uint8)
    start = b"\2\2" + width.to_bytes(2, "big")
    for row in pixels:
        if data[at : at + 4] != start:
            raise ValueError("a row is damaged")
        line, at = _row(data, at + 4, width)
        row[:] = np.frombuffer(line, np.uint8).reshape(4, width).T
    return pixels


def _row(data: bytes, at: int, width: int) -> tuple[bytes, int]:
    """The four channels of a row, concatenated, and the offset of the next row."""
    parts = []
    for _ in range(4):
        missing = width
        while missing > 0:
            count = data[at]
            if count > 128:
                count -= 128
                parts.append(data[at + 1 : at + 2] * count)
                at += 2
            else:
                parts.append(data[at + 1 : at + 1 + count])
                at += 1 + count
            missing -= count
            if count == 0 or missing < 0:
                raise ValueError("a run is damaged")
    line = b"".join(parts)
    if len(line) != 4 * width:
        raise ValueError("the file is incomplete")
    return line, at


def _light(pixels: np.ndarray) -> np.ndarray:
    """Linear light (H, W, 3) float32 of mantissas and exponents (H, W, 4) uint8."""
    scale = np.ldexp(np.float32(1), np.arange(256) - _BIAS).astype(np.float32)
    scale[0] = 0
    light: np.ndarray = pixels[..., :3] * scale[pixels[..., 3]][..., None]
    return light
