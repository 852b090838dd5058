"""Sound pictures of a small glossy ball, in the formats that photos come in; 24 x 20 pixels, so
that a reader is done in a millisecond.
"""

import io
import struct
import tempfile
import zlib
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
from PIL import Image

from isc_core.evidence_files import read_height
from isc_core.exr import read_channels
from isc_core.photo import read_photo

from .case import Case, Target

_EXR_KINDS = {
    "zip": OpenEXR.ZIP_COMPRESSION,
    "rle": OpenEXR.RLE_COMPRESSION,
    "piz": OpenEXR.PIZ_COMPRESSION,
    "pxr": OpenEXR.PXR24_COMPRESSION,
    "b44": OpenEXR.B44_COMPRESSION,
    "dwa": OpenEXR.DWAA_COMPRESSION,
    "none": OpenEXR.NO_COMPRESSION,
}
_PNG_WORDS = (b"IHDR", b"IDAT", b"IEND", b"PLTE", b"tRNS", b"eXIf", b"iCCP", b"zTXt", b"acTL")
_JPEG_WORDS = (
    b"\xff\xc0",
    b"\xff\xc2",
    b"\xff\xc4",
    b"\xff\xda",
    b"\xff\xdb",
    b"\xff\xdd",
    b"\xff\xe1",
    b"\xff\xd9",
    b"Exif\0\0",
    b"MM\0*",
)
_TIFF_WORDS = (
    b"II*\0",
    b"MM\0*",
    b"II+\0",
    b"\x00\x01",
    b"\x01\x01",
    b"\x02\x01",
    b"\x03\x01",
    b"\x06\x01",
    b"\x11\x01",
    b"\x15\x01",
    b"\x16\x01",
    b"\x17\x01",
    b"\x42\x01",
    b"\x44\x01",
    b"\x53\x01",
    b"\x52\x01",
    b"\x05\x80",
)
_EXR_WORDS = (
    b"channels\0chlist\0",
    b"compression\0",
    b"dataWindow\0box2i\0",
    b"displayWindow\0",
    b"tiles\0tiledesc\0",
    b"type\0string\0",
    b"deepscanline",
    b"preview\0preview\0",
    b"R\0",
    b"A\0",
    b"string\0",
    b"stringvector\0",
    b"rational\0",
    b"floatvector\0",
    b"keycode\0",
    b"timecode\0",
    b"chromaticities\0",
    b"view\0",
    b"chunkCount\0int\0",
)
_HDR_WORDS = (
    b"#?RADIANCE\n",
    b"FORMAT=32-bit_rle_rgbe\n",
    b"FORMAT=32-bit_rle_xyze\n",
    b"\n-Y 24 +X 20\n",
    b"+X 20 +Y 24\n",
    b"EXPOSURE=2\n",
    b"GAMMA=1\n",
    b"\x02\x02\x00\x14",
    b"\x02\x02\x7f\xff",
    b"\x01\x01\x01\xff",
)
_NPY_WORDS = (
    b"'descr'",
    b"'fortran_order'",
    b"'shape'",
    b"True",
    b"'<f8'",
    b"'|O'",
    b"'<U99999999'",
    b"(24, 20, 3)",
    b"(9, 3), ",
    b"-1",
    b"'|V0'",
    b"[('a', '<f4')]",
    b"1e9",
    b"L",
    b"'<c16'",
    b"('<f4', (2,))",
    b"'<M8[ns]'",
)


@cache
def ball() -> np.ndarray:
    """(24, 20, 3) float64 in [0, 1]: the ball, on black."""
    rows, columns = np.mgrid[:24, :20]
    toward = np.sqrt(np.maximum(1 - ((columns - 9.5) ** 2 + (rows - 11.5) ** 2) / 64, 0))
    light = np.where(toward > 0, 0.15 + 0.55 * toward + 0.25 * toward**30, 0)
    values: np.ndarray = np.clip(light[..., None] * np.array([1.0, 0.7, 0.4]), 0, 1)
    return values


def codes(bits: int = 8) -> np.ndarray:
    """(24, 20, 3) uint8 or uint16 of the ball."""
    return np.rint(ball() * (2**bits - 1)).astype(np.uint8 if bits == 8 else np.uint16)


def coded(suffix: str, pixels: np.ndarray, *options: int) -> bytes:
    """The file that OpenCV makes of (H, W) or (H, W, C) values in RGB(A) order."""
    order = {3: [2, 1, 0], 4: [2, 1, 0, 3]}.get(pixels.shape[2] if pixels.ndim == 3 else 0)
    done, data = cv2.imencode(
        suffix, pixels if order is None else np.ascontiguousarray(pixels[..., order]), list(options)
    )
    assert done
    return data.tobytes()


def saved(kind: str, mode: str = "RGB", **options: object) -> bytes:
    """The file that Pillow makes of the ball in a mode of its own."""
    stream = io.BytesIO()
    Image.fromarray(codes()).convert(mode).save(stream, kind, **options)
    return stream.getvalue()


def exr(channels: dict[str, np.ndarray], **header: object) -> bytes:
    """An OpenEXR file of float32 or float16 channels."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        pixels = {name: np.ascontiguousarray(values) for name, values in channels.items()}
        with OpenEXR.File(
            {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header},
            pixels,
        ) as file:
            file.write(str(path))
        return path.read_bytes()


def array(values: np.ndarray) -> bytes:
    """A `.npy` file."""
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=False)
    return stream.getvalue()


def with_checksums(data: bytes) -> bytes:
    """A PNG whose chunks have the checksums that belong to what they hold."""
    kept, at = [data[:8]], 8
    while at + 12 <= len(data):
        length = min(struct.unpack_from(">I", data, at)[0], len(data) - at - 12)
        content = data[at + 4 : at + 8 + length]
        kept.append(struct.pack(">I", length) + content + struct.pack(">I", zlib.crc32(content)))
        at += 12 + length
    return b"".join(kept) + data[at:]


def _photo(path: Path) -> object:
    return read_photo(path, whole_frame=True)


def _mask(path: Path) -> object:
    return read_photo(path.with_name("photo.png"), path)


def _height(path: Path) -> object:
    return read_height(path, (24, 20))


def _with_alpha(bits: int) -> np.ndarray:
    alpha = (ball().max(2, keepdims=True) > 0) * (2**bits - 1)
    return np.concatenate([codes(bits), alpha.astype(codes(bits).dtype)], axis=2)


def _png() -> tuple[Case, ...]:
    exif = Image.Exif()
    exif[0x0112] = 6
    grey = np.rint(ball()[..., 0] * 65535).astype(np.uint16)
    files = [
        coded(".png", codes()),
        coded(".png", codes(16)),
        coded(".png", _with_alpha(8)),
        coded(".png", _with_alpha(16)),
        coded(".png", codes(16), cv2.IMWRITE_PNG_COMPRESSION, 0),
        saved("png", "P"),
        saved("png", "1"),
        saved("png", "LA"),
        saved("png", exif=exif),
    ]
    cases = [
        Case("a.png", data, _photo, wrap)
        for data in files
        for wrap in (with_checksums, with_checksums, bytes)
    ]
    cases += [
        Case("a.png", coded(".png", grey), read, with_checksums) for read in (_height, _photo)
    ]
    mask = coded(".png", (ball().max(2) > 0).astype(np.uint8) * 255)
    return (*cases, Case("mask.png", mask, _mask, with_checksums, {"photo.png": files[0]}))


def _jpeg() -> tuple[Case, ...]:
    exif = Image.Exif()
    exif[0x0112] = 5
    files = [
        saved("jpeg", quality=90),
        saved("jpeg", progressive=True),
        saved("jpeg", "L"),
        saved("jpeg", exif=exif),
        saved("jpeg", "CMYK"),
        saved("jpeg", subsampling=2, restart_marker_blocks=1),
    ]
    return tuple(Case("a.jpg", data, _photo) for data in files)


def _tiled() -> bytes:
    """A TIFF of 16 bits in four tiles of 16 x 16 pixels, which neither library writes."""
    padded = np.zeros((32, 32, 3), "<u2")
    padded[:24, :20] = codes(16)
    tiles = [padded[y : y + 16, x : x + 16].tobytes() for y in (0, 16) for x in (0, 16)]
    behind = (
        8 + 2 + 12 * 11 + 4
    )  # where what fits in no entry begins: three numbers, two lists of four
    start = behind + 6 + 32
    places = struct.pack("<4I", *(start + k * len(tiles[0]) for k in range(4)))
    entries = (
        (256, 4, 1, 20),
        (257, 4, 1, 24),
        (258, 3, 3, behind),
        (259, 3, 1, 1),
        (262, 3, 1, 2),
        (277, 3, 1, 3),
        (284, 3, 1, 1),
        (322, 4, 1, 16),
        (323, 4, 1, 16),
        (324, 4, 4, behind + 6),
        (325, 4, 4, behind + 22),
    )
    directory = (
        struct.pack("<H", len(entries))
        + b"".join(struct.pack("<HHII", *entry) for entry in entries)
        + bytes(4)
    )
    lengths = struct.pack("<4I", *(len(tile) for tile in tiles))
    return (
        b"II*\0\x08\0\0\0"
        + directory
        + struct.pack("<3H", 16, 16, 16)
        + places
        + lengths
        + b"".join(tiles)
    )


def _tiff() -> tuple[Case, ...]:
    grey = np.rint(ball()[..., 0] * 65535).astype(np.uint16)
    compressions = (1, 5, 8, 32773)
    files = [coded(".tiff", codes(16), cv2.IMWRITE_TIFF_COMPRESSION, n) for n in compressions]
    files += [
        coded(".tiff", ball().astype(np.float32), cv2.IMWRITE_TIFF_COMPRESSION, n) for n in (1, 5)
    ]
    files += [
        coded(".tiff", _with_alpha(16)),
        coded(".tiff", codes(16), cv2.IMWRITE_TIFF_ROWSPERSTRIP, 3),
    ]
    files += [
        saved("tiff", compression=name)
        for name in (None, "tiff_lzw", "tiff_adobe_deflate", "packbits", "jpeg")
    ]
    files += [
        saved("tiff", "P"),
        saved("tiff", "1", compression="group4"),
        saved("tiff", "LAB"),
        saved("tiff", big_tiff=True),
        _tiled(),
    ]
    return (
        *(Case("a.tif", data, _photo) for data in files),
        Case("a.tif", coded(".tiff", grey), _height),
    )


def _exr() -> tuple[Case, ...]:
    light = ball().astype(np.float32)
    planes = {name: light[..., k] for k, name in enumerate("RGB")}
    alpha = (light.max(2) > 0).astype(np.float32)
    layers = {
        f"{layer}.{name}": values
        for layer in ("diffuse", "specular")
        for name, values in planes.items()
    }
    window = (np.array([2, 3], np.int32), np.array([29, 30], np.int32))
    files = [exr(planes, compression=kind) for kind in _EXR_KINDS.values()]
    files += [
        exr(planes | {"A": alpha}),
        exr({name: values.astype(np.float16) for name, values in planes.items()}),
        exr(planes, displayWindow=window),
        exr({"Y": alpha}),
        exr(planes, type=OpenEXR.tiledimage, tiles=OpenEXR.TileDescription()),
    ]
    cases = [Case("a.exr", data, read) for data in files for read in (_photo, read_channels)]
    return (
        *cases,
        Case("a.exr", exr(layers), read_channels),
        Case("a.exr", exr({"height.Z": alpha, "mask.A": alpha}), _height),
    )


def _hdr() -> tuple[Case, ...]:
    light = ball().astype(np.float32)
    wide = np.concatenate([light, light[:, ::-1]], axis=1)
    return (
        Case(
            "a.hdr",
            coded(".hdr", light, cv2.IMWRITE_HDR_COMPRESSION, cv2.IMWRITE_HDR_COMPRESSION_NONE),
            _photo,
        ),
        *(
            Case(
                "a.hdr",
                coded(
                    ".hdr", picture, cv2.IMWRITE_HDR_COMPRESSION, cv2.IMWRITE_HDR_COMPRESSION_RLE
                ),
                _photo,
            )
            for picture in (light, wide)
        ),
    )


def _plain() -> tuple[Case, ...]:
    files = [
        saved("bmp"),
        saved("bmp", "P"),
        saved("bmp", "1"),
        saved("bmp", "RGBA"),
        saved("ppm"),
        saved("ppm", "L"),
        saved("ppm", "1"),
        b"P3 8 9 255 " + b"7 200 31 " * 72,
        b"P6 20 24 65535\n" + codes(16).astype(">u2").tobytes(),
    ]
    return tuple(Case("a.ppm", data, _photo) for data in files)


def _npy() -> tuple[Case, ...]:
    light, height = ball().astype(np.float32), np.where(ball().max(2) > 0, ball()[..., 0], np.nan)
    cases = [
        Case("a.npy", array(values), _photo)
        for values in (light, codes(), codes(16), np.asfortranarray(light), _with_alpha(8))
    ]
    return (
        *cases,
        Case("a.npy", array(height), _height),
        Case("mask.npy", array(light[..., 0] > 0), _mask, beside={"photo.png": saved("png")}),
    )


PICTURES = (
    Target("png", _png, _PNG_WORDS),
    Target("jpeg", _jpeg, _JPEG_WORDS),
    Target("tiff", _tiff, _TIFF_WORDS),
    Target("exr", _exr, _EXR_WORDS),
    Target("hdr", _hdr, _HDR_WORDS),
    Target(
        "bmp-ppm",
        _plain,
        (b"BM", b"P5", b"P6", b"P3", b"#", b"65535 ", b"\x28\0\0\0", b"\x01\0\0\0"),
    ),
    Target("npy", _npy, _NPY_WORDS),
)
