"""PNG files of 8 or 16 bits, without an image library: Blender's own process loads none.

Format: W3C Recommendation "Portable Network Graphics" (2003), ISO/IEC 15948. Every row has the
filter 0; the pixels are one deflate stream.
"""

import struct
import zlib

import numpy as np

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOR_TYPES = {1: 0, 3: 2, 4: 6}  # by the number of channels


def encode_png(codes: np.ndarray, compression: int = 6) -> bytes:
    """Encode an image.

    Parameters
    ----------
    codes : (H, W), (H, W, 3) or (H, W, 4) ndarray of uint8 or uint16
        Row 0 at the top.
    compression : int, optional
        From 1, fast, to 9, small.

    Returns
    -------
    bytes
        The file.
    """
    rows, columns = codes.shape[:2]
    channels = codes.shape[2] if codes.ndim == 3 else 1
    depth = 8 * codes.dtype.itemsize
    lines = np.ascontiguousarray(codes, codes.dtype.newbyteorder(">")).reshape(rows, -1)
    filtered = np.zeros((rows, 1 + lines.shape[1] * codes.dtype.itemsize), np.uint8)
    filtered[:, 1:] = lines.view(np.uint8)
    header = struct.pack(">IIBBBBB", columns, rows, depth, _COLOR_TYPES[channels], 0, 0, 0)
    data = zlib.compress(filtered.data, compression)
    return _SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", data) + _chunk(b"IEND", b"")


def decode_png(data: bytes) -> np.ndarray:
    """Decode an image that `encode_png` has written.

    Parameters
    ----------
    data : bytes
        The file; 8 bits.

    Returns
    -------
    (H, W), (H, W, 3) or (H, W, 4) ndarray of uint8
        Row 0 at the top.
    """
    start = len(_SIGNATURE) + 8
    columns, rows, depth, color_type = struct.unpack(">IIBB", data[start : start + 10])
    assert depth == 8
    channels = next(number for number, kind in _COLOR_TYPES.items() if kind == color_type)
    length, _ = struct.unpack(">I4s", data[start + 17 : start + 25])
    lines = zlib.decompress(data[start + 25 : start + 25 + length])
    codes = np.frombuffer(lines, np.uint8).reshape(rows, 1 + columns * channels)[:, 1:]
    shape = (rows, columns) if channels == 1 else (rows, columns, channels)
    return codes.reshape(shape)


def _chunk(kind: bytes, data: bytes) -> bytes:
    checksum = zlib.crc32(kind + data)
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", checksum)
