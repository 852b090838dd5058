"""OpenEXR files of 32-bit floats, without an image library: Blender's own process loads none.

Format: "Technical Introduction to OpenEXR" and "OpenEXR File Layout" (Industrial Light & Magic,
2013): one part of scan lines in blocks of 16, whose bytes are split into even and odd ones,
replaced by their differences, and deflated (the compression "ZIP").

The differences of floats seldom repeat but in runs of one byte, so deflation looks for nothing else
(zlib's strategy RLE): two thirds of the time of its fastest level, for 6 % more bytes.

Limits: no metadata, and pixels are square.
"""

import struct
import zlib

import numpy as np

_MAGIC, _VERSION, _ZIP, _FLOAT = 20000630, 2, 3, 2
_LINES = 16  # of a block
_CHANNELS = {1: "Y", 3: "RGB", 4: "RGBA"}


def encode_exr(values: np.ndarray) -> bytes:
    """Encode an image.

    Parameters
    ----------
    values : (H, W), (H, W, 3) or (H, W, 4) ndarray
        Row 0 at the top; written as float32. Single values become a luminance.

    Returns
    -------
    bytes
        The file.
    """
    planes = values[..., None] if values.ndim == 2 else values
    rows, columns, channels = planes.shape
    names = _CHANNELS[channels]
    order = sorted(range(channels), key=names.__getitem__)
    header = _header(columns, rows, sorted(names))
    blocks = [_block(planes[top : top + _LINES][..., order], top) for top in range(0, rows, _LINES)]
    places = len(header) + 8 * len(blocks) + np.cumsum([0, *map(len, blocks)])[:-1]
    return b"".join([header, places.astype("<u8").tobytes(), *blocks])


def _header(columns: int, rows: int, names: list[str]) -> bytes:
    channels = b"".join(
        name.encode() + b"\0" + struct.pack("<iB3xii", _FLOAT, 0, 1, 1) for name in names
    )
    window = struct.pack("<4i", 0, 0, columns - 1, rows - 1)
    attributes = [
        ("channels", "chlist", channels + b"\0"),
        ("compression", "compression", bytes([_ZIP])),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
    ]
    packed = b"".join(
        f"{name}\0{kind}\0".encode() + struct.pack("<i", len(data)) + data
        for name, kind, data in attributes
    )
    return struct.pack("<ii", _MAGIC, _VERSION) + packed + b"\0"


def _block(lines: np.ndarray, top: int) -> bytes:
    """The block of `lines`, (n, W, channels), which begins in the row `top`."""
    raw = np.ascontiguousarray(lines.transpose(0, 2, 1), "<f4").reshape(-1).view(np.uint8)
    split = np.concatenate([raw[0::2], raw[1::2]])
    differences = split.copy()
    differences[1:] += 128 - split[:-1]  # modulo 256
    deflated = zlib.compressobj(strategy=zlib.Z_RLE)
    data = deflated.compress(differences.data) + deflated.flush()
    if len(data) >= raw.size:
        data = raw.tobytes()
    return struct.pack("<ii", top, len(data)) + data
