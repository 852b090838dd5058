"""PNG files of 8 or 16 bits without an image library, for Blender's own process.

Every row has the filter Sub (differences from the previous pixel). The pixels are one deflate
stream.

Citation: W3C Recommendation "Portable Network Graphics" (2003), ISO/IEC 15948.
"""

import struct
import zlib

import numpy as np

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOR_TYPES = {1: 0, 3: 2, 4: 6}  # by the number of channels
_SUB = 1
_LENGTH_AND_KIND, _HEADER_LENGTH, _CHECKSUM = 8, 13, 4  # bytes


def encode_png(codes: np.ndarray, compression: int = 6) -> bytes:
    """Encode an image.

    Parameters
    ----------
    codes : (H, W), (H, W, 1), (H, W, 3) or (H, W, 4) ndarray of uint8 or uint16
        Row 0 at the top.
    compression : int, optional
        From 1, run lengths only, which is enough for photos, to 9, the smallest file.

    Returns
    -------
    bytes
        The file.
    """
    rows, columns = codes.shape[:2]
    channels = codes.shape[2] if codes.ndim == 3 else 1
    depth = 8 * codes.dtype.itemsize
    lines = np.ascontiguousarray(codes, codes.dtype.newbyteorder(">")).view(np.uint8)
    lines = lines.reshape(rows, -1)
    step = channels * codes.dtype.itemsize
    filtered = np.empty((rows, 1 + lines.shape[1]), np.uint8)
    filtered[:, 0] = _SUB
    filtered[:, 1 : 1 + step] = lines[:, :step]
    np.subtract(lines[:, step:], lines[:, :-step], out=filtered[:, 1 + step :])
    header = struct.pack(">IIBBBBB", columns, rows, depth, _COLOR_TYPES[channels], 0, 0, 0)
    strategy = zlib.Z_RLE if compression == 1 else zlib.Z_DEFAULT_STRATEGY
    packer = zlib.compressobj(compression, strategy=strategy)
    data = packer.compress(filtered.data) + packer.flush()
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    return SIGNATURE + b"".join(png_chunk(*chunk) for chunk in chunks)


def decode_png(data: bytes) -> np.ndarray:
    """Decode an image of 8 bits that `encode_png` has written.

    Parameters
    ----------
    data : bytes
        The file.

    Returns
    -------
    (H, W), (H, W, 3) or (H, W, 4) ndarray of uint8
        Row 0 at the top.

    Raises
    ------
    ValueError
        If another program wrote it, or its codes have 16 bits.
    """
    start = len(SIGNATURE) + _LENGTH_AND_KIND
    columns, rows, depth, color_type = struct.unpack_from(">IIBB", data, start)
    start += _HEADER_LENGTH + _CHECKSUM
    (length,) = struct.unpack_from(">I", data, start)
    start += _LENGTH_AND_KIND
    channels = next((n for n, kind in _COLOR_TYPES.items() if kind == color_type), 0)
    lines = np.frombuffer(zlib.decompress(data[start : start + length]), np.uint8)
    if depth != 8 or lines.size != rows * (1 + columns * channels):
        raise ValueError("the PNG is of another kind")
    lines = lines.reshape(rows, -1)
    if (lines[:, 0] != _SUB).any():
        raise ValueError("the PNG has other filters")
    shape = (rows, columns, channels)
    codes = np.cumsum(lines[:, 1:].reshape(shape), axis=1, dtype=np.uint8)
    return codes[..., 0] if channels == 1 else codes


def png_chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG: its length, kind, content and checksum.

    Parameters
    ----------
    kind : bytes
        Four letters.
    data : bytes
        The content.

    Returns
    -------
    bytes
    """
    checksum = zlib.crc32(data, zlib.crc32(kind))
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", checksum)
