"""Camera raw files made by hand: a DNG of a Bayer sensor."""

import struct
from collections.abc import Sequence

import numpy as np

XYZ_TO_SRGB = np.linalg.inv(
    np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175],
         [0.0193339, 0.119192, 0.9503041]]
    )
)  # fmt: skip
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 10: 8}
_CODES = {3: "H", 4: "I"}


def mosaic(rgb: np.ndarray) -> np.ndarray:
    """(H, W) of what an RGGB sensor records of (H, W, 3)."""
    cfa = rgb[..., 1].copy()
    cfa[::2, ::2], cfa[1::2, 1::2] = rgb[::2, ::2, 0], rgb[1::2, 1::2, 2]
    return cfa


def dng(
    cfa: np.ndarray, *, neutral: tuple[float, float, float] = (1, 1, 1), black: int = 0,
    white: int = 16383, orientation: int = 1, matrix: np.ndarray | None = XYZ_TO_SRGB,
    order: str = "<", claimed: tuple[int, int] | None = None,
) -> bytes:  # fmt: skip
    """A DNG of (H, W) codes of an RGGB sensor.

    `neutral` is the camera's colour of white, `matrix` from XYZ to the camera's colours, None for
    an unknown one; `claimed` replaces height and width.
    """
    pixels = cfa.astype(f"{order}u2").tobytes()
    height, width = claimed or cfa.shape
    tags: list[tuple[int, int, Sequence[float]]] = [
        *((254, 4, [0]), (256, 4, [width]), (257, 4, [height]), (258, 3, [16]), (259, 3, [1])),
        *((262, 3, [32803]), (271, 2, [*b"Test\0"]), (272, 2, [*b"Test Camera\0"])),
        *((273, 4, [0]), (274, 3, [orientation]), (277, 3, [1]), (278, 4, [height])),
        *((279, 4, [len(pixels)]), (33421, 3, [2, 2]), (33422, 1, [0, 1, 1, 2])),
        *((50706, 1, [1, 4, 0, 0]), (50707, 1, [1, 1, 0, 0]), (50708, 2, [*b"Test Camera\0"])),
        *((50714, 3, [black]), (50717, 4, [white]), (50728, 5, [*neutral]), (50778, 3, [21])),
    ]
    if matrix is not None:
        tags.append((50721, 10, [*matrix.ravel()]))
    return _tiff(sorted(tags), pixels, order)


def _tiff(tags: list[tuple[int, int, Sequence[float]]], pixels: bytes, order: str) -> bytes:
    values = [_packed(kind, numbers, order) for _, kind, numbers in tags]
    start = 8 + 2 + 12 * len(tags) + 4
    end = start + sum(len(value) + len(value) % 2 for value in values if len(value) > 4)
    table, content = b"", b""
    for (tag, kind, _), value in zip(tags, values, strict=True):
        count, field = len(value) // _SIZES[kind], value
        if tag == 273:
            field = struct.pack(f"{order}I", end)
        if len(value) > 4:
            field = struct.pack(f"{order}I", start + len(content))
            content += value + bytes(len(value) % 2)
        table += struct.pack(f"{order}HHI", tag, kind, count) + field.ljust(4, b"\0")
    mark = b"II*\0" if order == "<" else b"MM\0*"
    header = mark + struct.pack(f"{order}IH", 8, len(tags))
    return header + table + bytes(4) + content + pixels


def _packed(kind: int, numbers: Sequence[float], order: str) -> bytes:
    if kind in (1, 2):
        return bytes(int(n) for n in numbers)
    if kind in (5, 10):
        code = "II" if kind == 5 else "ii"
        pairs = (struct.pack(f"{order}{code}", round(1e6 * n), 1_000_000) for n in numbers)
        return b"".join(pairs)
    return struct.pack(f"{order}{len(numbers)}{_CODES[kind]}", *(int(n) for n in numbers))
