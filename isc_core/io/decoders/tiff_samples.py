"""Samples of TIFF files of 16 bits and floats, which Pillow reduces to 8 bits or does not support.

Problem: libtiff, which Pillow includes, decompresses all kinds of TIFF, but Pillow supports few
pixel formats.

Method: the compressed bytes of a strip or tile are wrapped in a TIFF of grey bytes, from which
Pillow reads its decompressed content. The predictors are undone here: with 2, each sample is stored
as the difference from the previous pixel's; with 3, the bytes of a row's floats are sorted by their
significance, and differences are between bytes.

Citation: TIFF Revision 6.0 (1992), sections 3, 14 and 15; Adobe Photoshop TIFF Technical Note 3
(2005).

Limits: lossless compression of bytes (none, LZW, Deflate, PackBits, Zstandard, LZMA).
"""

import io
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import TiffImagePlugin

_COMPRESSIONS = (1, 5, 8, 32773, 32946, 34925, 50000)
_FLOATS, _UNSIGNED = 3, 1
_LONG = 4
_WIDEST_TILE = 1 << 14


@dataclass(frozen=True)
class _Grid:
    """The division of a plane's pixels into strips of all columns, or into tiles.

    Attributes
    ----------
    rows, columns : int
        Of a strip or tile; the last strip may be shorter.
    down, across : int
        Number of strips or tiles.
    tiled : bool
    """

    rows: int
    columns: int
    down: int
    across: int
    tiled: bool


def tiff_samples(data: bytes, tags: Mapping[int, Any]) -> np.ndarray:
    """Return the samples of the page that the tags describe.

    Parameters
    ----------
    data : bytes
        The whole file.
    tags : mapping of int to Any
        Values by number.

    Returns
    -------
    (H, W, C) ndarray
        uint16, float16, float32 or float64; without the orientation applied.

    Raises
    ------
    OSError, ValueError, KeyError
        If the file is damaged, incomplete or of another compression.
    """
    width, height = int(tags[256]), int(tags[257])
    samples, planar = int(tags.get(277, 1)), int(tags.get(284, 1))
    kind = sample_type(tags)
    if kind is None or int(tags.get(259, 1)) not in _COMPRESSIONS:
        raise ValueError("samples of another kind")
    kind = kind.newbyteorder("<" if data[:2] == b"II" else ">")
    planes, depth = (samples, 1) if planar == 2 else (1, samples)
    grid = _grid(tags, width, height)
    parts = _parts(data, tags, grid, planes * grid.down * grid.across)
    each = grid.down * grid.across
    found = [
        _plane(parts[k * each : (k + 1) * each], tags, grid, height, depth, kind)[:height, :width]
        for k in range(planes)
    ]
    return np.concatenate(found, axis=2) if planes > 1 else found[0]


def sample_type(tags: Mapping[int, Any]) -> np.dtype[Any] | None:
    """Return the type of all samples, in native byte order; None if it is not supported.

    Parameters
    ----------
    tags : mapping of int to Any
        Values by number.

    Returns
    -------
    dtype or None
    """
    bits, stores = ({int(n) for n in np.ravel(tags.get(tag, 1))} for tag in (258, 339))
    if stores == {_FLOATS} and bits in ({16}, {32}, {64}):
        return np.dtype(f"f{bits.pop() // 8}")
    return np.dtype(np.uint16) if stores == {_UNSIGNED} and bits == {16} else None


def _grid(tags: Mapping[int, Any], width: int, height: int) -> _Grid:
    if 322 in tags:
        columns, rows = int(tags[322]), int(tags[323])
        if not (0 < columns <= _WIDEST_TILE and 0 < rows <= _WIDEST_TILE):
            raise ValueError("tiles of an unusual size")
        if rows * columns > 4 * max(height * width, 1 << 20):
            raise ValueError("tiles much larger than the picture")
        return _Grid(rows, columns, -(-height // rows), -(-width // columns), True)
    rows = min(int(tags.get(278, height)), height)
    if rows < 1:
        raise ValueError("strips without rows")
    return _Grid(rows, width, -(-height // rows), 1, False)


def _parts(data: bytes, tags: Mapping[int, Any], grid: _Grid, count: int) -> list[bytes]:
    """The compressed bytes of all strips or tiles."""
    at, lengths = (
        [int(n) for n in np.ravel(tags[tag])] for tag in ((324, 325) if grid.tiled else (273, 279))
    )
    if len(at) < count or len(lengths) < count or sum(lengths) > 2 * len(data):
        raise ValueError("strips or tiles are missing")
    places = list(zip(at, lengths, strict=True))[:count]
    if any(start < 0 or length <= 0 or start + length > len(data) for start, length in places):
        raise ValueError("the file is incomplete")
    return [data[start : start + length] for start, length in places]


def _plane(
    parts: list[bytes],
    tags: Mapping[int, Any],
    grid: _Grid,
    height: int,
    depth: int,
    kind: np.dtype[Any],
) -> np.ndarray:
    """Samples (rows, columns, depth) of adjacent strips or tiles."""
    line = grid.columns * depth * kind.itemsize
    rows = grid.down * grid.rows if grid.tiled else height
    packed = _as_grey(parts, tags, grid, line * grid.across, rows, line)
    values = packed.reshape(rows, grid.across, grid.columns, depth * kind.itemsize)
    return _without_predictor(values, int(tags.get(317, 1)), kind).reshape(
        rows, grid.across * grid.columns, depth
    )


def _as_grey(
    parts: list[bytes], tags: Mapping[int, Any], grid: _Grid, width: int, rows: int, line: int
) -> np.ndarray:
    """The decompressed bytes (rows, width) uint8 of strips or tiles with lines of `line` bytes."""
    entries = {256: width, 257: rows, 258: 8, 259: int(tags.get(259, 1)), 262: 1, 277: 1}
    entries[266] = int(tags.get(266, 1))
    entries |= {322: line, 323: grid.rows} if grid.tiled else {278: grid.rows}
    places = (324, 325) if grid.tiled else (273, 279)
    count = len(parts)
    table = 8 + 2 + 12 * (len(entries) + 2) + 4
    start = table + 8 * count
    lengths = np.array([len(part) for part in parts], "<u4")
    at = (start + np.cumsum(lengths) - lengths).astype("<u4")
    fields = [(tag, _LONG, 1, value) for tag, value in entries.items()]
    for tag, values, k in ((places[0], at, 0), (places[1], lengths, 1)):
        fields.append((tag, _LONG, count, int(values[0]) if count == 1 else table + 4 * count * k))
    directory = b"".join(struct.pack("<HHII", *field) for field in sorted(fields))
    head = b"II*\0" + struct.pack("<IH", 8, len(fields)) + directory + bytes(4)
    file = b"".join([head, at.tobytes(), lengths.tobytes(), *parts])
    image = TiffImagePlugin.TiffImageFile(io.BytesIO(file))
    image.load()
    return np.asarray(image)


def _without_predictor(values: np.ndarray, predictor: int, kind: np.dtype[Any]) -> np.ndarray:
    """Samples (rows, across, columns, depth) of bytes (rows, across, columns, depth size)."""
    if predictor == 1:
        return values.view(kind)
    if predictor == 2:
        whole = np.dtype(f"{kind.byteorder}u{kind.itemsize}")
        native = values.view(whole).astype(whole.newbyteorder("="))
        return np.cumsum(native, axis=2, dtype=native.dtype).view(kind.newbyteorder("="))
    if predictor != 3:
        raise ValueError("an unknown predictor")
    rows, across, columns, step = values.shape
    depth = step // kind.itemsize
    lines = values.reshape(rows, across, columns * kind.itemsize, depth)
    line = np.cumsum(lines, axis=2, dtype=np.uint8)
    sorted_bytes = line.reshape(rows, across, kind.itemsize, columns * depth)
    big = np.ascontiguousarray(np.moveaxis(sorted_bytes, 2, 3))
    return big.view(kind.newbyteorder(">")).reshape(rows, across, columns, depth)
