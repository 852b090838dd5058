"""PNG files of 8 or 16 bits, without an image library: Blender's own process loads none.

Every row has the filter Sub: differences from the pixel before. The pixels are one deflate stream.

Citation: W3C Recommendation "Portable Network Graphics" (2003), ISO/IEC 15948.
"""

import struct
import zlib

import numpy as np

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOR_TYPES = {1: 0, 3: 2, 4: 6}  # by the number of channels
_SUB = 1


def encode_png(codes: np.ndarray, compression: int = 6) -> bytes:
    """Encode an image.

    Parameters
    ----------
    codes : (H, W), (H, W, 1), (H, W, 3) or (H, W, 4) ndarray of uint8 or uint16
        Row 0 at the top.
    compression : int, optional
        From 1, run lengths alone, which photos need no more than, to 9, small.

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
