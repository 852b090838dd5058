"""Sound pictures of a small glossy ball, in the formats of photos.

24 x 20 pixels, so that reading takes a millisecond.
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
import pillow_heif
from PIL import Image

from isc_core.errors import InputError
from isc_core.io.exr import read_channels
from isc_core.io.reading_notes import ReadingNoteKind
from isc_core.photo import WholeFrame, read_photo
from isc_core.result_files.known_inputs import read_height
from tests.core.photo.icc_profiles import (
    P3,
    SRGB_CURVE,
    gamma_curve,
    grey_profile,
    parametric_curve,
    rgb_profile,
    sampled_curve,
    table_profile,
    to_d50,
)
from tests.core.photo.raw_files import dng, mosaic
from tests.fuzz.case import Case, Target, words

_PNG_WORDS = words(b"IHDR~IDAT~IEND~PLTE~tRNS~eXIf~iCCP~zTXt~acTL")
_JPEG_WORDS = words(
    b"\xff\xc0~\xff\xc2~\xff\xc4~\xff\xda~\xff\xdb~\xff\xdd~\xff\xe1~\xff\xd9~Exif\x00\x00~MM\x00*"
)
_TIFF_WORDS = words(
    b"II*\x00~MM\x00*~II+\x00~\x00\x01~\x01\x01~\x02\x01~\x03\x01~\x06\x01~\x11\x01~"
    b"\x15\x01~\x16\x01~\x17\x01~B\x01~D\x01~S\x01~R\x01~\x05\x80"
)
_EXR_WORDS = words(
    b"channels\x00chlist\x00~compression\x00~dataWindow\x00box2i\x00~displayWindow\x00~"
    b"tiles\x00tiledesc\x00~type\x00string\x00~deepscanline~preview\x00preview\x00~R\x00~"
    b"A\x00~string\x00~stringvector\x00~rational\x00~floatvector\x00~keycode\x00~"
    b"timecode\x00~chromaticities\x00~view\x00~chunkCount\x00int\x00"
)
_HDR_WORDS = words(
    b"#?RADIANCE\n~FORMAT=32-bit_rle_rgbe\n~FORMAT=32-bit_rle_xyze\n~\n-Y 24 +X 20\n~"
    b"+X 20 +Y 24\n~EXPOSURE=2\n~GAMMA=1\n~\x02\x02\x00\x14~\x02\x02\x7f\xff~"
    b"\x01\x01\x01\xff"
)
_NPY_WORDS = words(
    b"'descr'~'fortran_order'~'shape'~True~'<f8'~'|O'~'<U99999999'~(24, 20, 3)~(9, 3), ~-1~"
    b"'|V0'~[('a', '<f4')]~1e9~L~'<c16'~('<f4', (2,))~'<M8[ns]'"
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
    return read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK)


def _photo_of_profile(path: Path) -> object:
    """A broken profile is a note, which counts as a refusal here."""
    photo = read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK)
    if any(note.kind is ReadingNoteKind.BROKEN_PROFILE for note in photo.original.notes):
        raise InputError("broken")
    return photo


def _mask(path: Path) -> object:
    return read_photo(path.with_name("photo.png"), path)


def _height(path: Path) -> object:
    return read_height(path, (24, 20))


def _inside() -> np.ndarray:
    return ball().max(axis=2) > 0


def _with_alpha(bits: int) -> np.ndarray:
    alpha = _inside()[..., None] * (2**bits - 1)
    return np.concatenate([codes(bits), alpha.astype(codes(bits).dtype)], axis=2)


def _grey() -> np.ndarray:
    return np.rint(ball()[..., 0] * 65535).astype(np.uint16)


def _turned(orientation: int) -> Image.Exif:
    exif = Image.Exif()
    exif[0x0112] = orientation
    return exif


def _png() -> tuple[Case, ...]:
    pixels = (codes(), codes(16), _with_alpha(8), _with_alpha(16))
    files = [coded(".png", values) for values in pixels]
    files += [coded(".png", codes(16), cv2.IMWRITE_PNG_COMPRESSION, 0)]
    files += [*(saved("png", mode) for mode in ("P", "1", "LA")), saved("png", exif=_turned(6))]
    wraps, grey = (with_checksums, with_checksums, bytes), coded(".png", _grey())
    mask, beside = coded(".png", _inside().astype(np.uint8) * 255), {"photo.png": files[0]}
    return (
        *(Case("a.png", data, _photo, wrap) for data in files for wrap in wraps),
        *(Case("a.png", grey, read, with_checksums) for read in (_height, _photo)),
        Case("mask.png", mask, _mask, with_checksums, beside),
    )


def _jpeg() -> tuple[Case, ...]:
    files = (
        saved("jpeg", quality=90),
        saved("jpeg", progressive=True),
        saved("jpeg", "L"),
        saved("jpeg", exif=_turned(5)),
        saved("jpeg", "CMYK"),
        saved("jpeg", subsampling=2, restart_marker_blocks=1),
    )
    return tuple(Case("a.jpg", data, _photo) for data in files)


def _tiled() -> bytes:
    """A TIFF of 16 bits in four tiles of 16 x 16 pixels, which neither library writes."""
    padded = np.zeros((32, 32, 3), "<u2")
    padded[:24, :20] = codes(16)
    tiles = [padded[y : y + 16, x : x + 16].tobytes() for y in (0, 16) for x in (0, 16)]
    behind = 8 + 2 + 12 * 11 + 4  # where values begin that fit in no entry
    start = behind + 6 + 32
    one = ((256, 4, 1, 20), (257, 4, 1, 24), (258, 3, 3, behind), (259, 3, 1, 1), (262, 3, 1, 2))
    two = ((277, 3, 1, 3), (284, 3, 1, 1), (322, 4, 1, 16), (323, 4, 1, 16))
    entries = (*one, *two, (324, 4, 4, behind + 6), (325, 4, 4, behind + 22))
    directory = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    lengths = [len(tile) for tile in tiles]
    places = [start + k * lengths[0] for k in range(4)]
    values = struct.pack("<3H8I", 16, 16, 16, *places, *lengths)
    header = b"II*\0\x08\0\0\0" + struct.pack("<H", len(entries)) + directory + bytes(4)
    return header + values + b"".join(tiles)


def _tiff() -> tuple[Case, ...]:
    kind, light = cv2.IMWRITE_TIFF_COMPRESSION, ball().astype(np.float32)
    files = [coded(".tiff", codes(16), kind, n) for n in (1, 5, 8, 32773)]
    files += [coded(".tiff", light, kind, n) for n in (1, 5)]
    files += [coded(".tiff", codes(16), cv2.IMWRITE_TIFF_ROWSPERSTRIP, 3)]
    names = (None, "tiff_lzw", "tiff_adobe_deflate", "packbits", "jpeg")
    files += [saved("tiff", compression=name) for name in names]
    files += [saved("tiff", "P"), saved("tiff", "1", compression="group4"), saved("tiff", "LAB")]
    files += [coded(".tiff", _with_alpha(16)), saved("tiff", big_tiff=True), _tiled()]
    cases = tuple(Case("a.tif", data, _photo) for data in files)
    return (*cases, Case("a.tif", coded(".tiff", _grey()), _height))


def _exr() -> tuple[Case, ...]:
    light, alpha = ball().astype(np.float32), _inside().astype(np.float32)
    planes = {name: light[..., k] for k, name in enumerate("RGB")}
    both = [(layer, name) for layer in ("diffuse", "specular") for name in "RGB"]
    layers = {f"{layer}.{name}": planes[name] for layer, name in both}
    window = (np.array([2, 3], np.int32), np.array([29, 30], np.int32))
    kinds = ("ZIP", "RLE", "PIZ", "PXR24", "B44", "DWAA", "NO")
    files = [exr(planes, compression=getattr(OpenEXR, f"{kind}_COMPRESSION")) for kind in kinds]
    files += [
        exr(planes | {"A": alpha}),
        exr({name: values.astype(np.float16) for name, values in planes.items()}),
        exr(planes, displayWindow=window),
        exr({"Y": alpha}),
        exr(planes, type=OpenEXR.tiledimage, tiles=OpenEXR.TileDescription()),
    ]
    return (
        *(Case("a.exr", data, read) for data in files for read in (_photo, read_channels)),
        Case("a.exr", exr(layers), read_channels),
        Case("a.exr", exr({"height.Z": alpha, "mask.A": alpha}), _height),
    )


def _hdr() -> tuple[Case, ...]:
    light = ball().astype(np.float32)
    wide = np.concatenate([light, light[:, ::-1]], axis=1)
    plain, packed = cv2.IMWRITE_HDR_COMPRESSION_NONE, cv2.IMWRITE_HDR_COMPRESSION_RLE
    files = ((light, plain), (light, packed), (wide, packed))
    coding = cv2.IMWRITE_HDR_COMPRESSION
    return tuple(Case("a.hdr", coded(".hdr", image, coding, kind), _photo) for image, kind in files)


def _plain() -> tuple[Case, ...]:
    files = [saved("bmp", mode) for mode in ("RGB", "P", "1", "RGBA")]
    files += [saved("ppm", mode) for mode in ("RGB", "L", "1")]
    files += [b"P3 8 9 255 " + b"7 200 31 " * 72]
    files += [b"P6 20 24 65535\n" + codes(16).astype(">u2").tobytes()]
    return tuple(Case("a.ppm", data, _photo) for data in files)


def _npy() -> tuple[Case, ...]:
    light, height = ball().astype(np.float32), np.where(_inside(), ball()[..., 0], np.nan)
    files = (light, codes(), codes(16), np.asfortranarray(light), _with_alpha(8))
    return (
        *(Case("a.npy", array(values), _photo) for values in files),
        Case("a.npy", array(height), _height),
        Case("mask.npy", array(light[..., 0] > 0), _mask, beside={"photo.png": saved("png")}),
    )


def _with_profile(profile: bytes) -> bytes:
    return saved("png", icc_profile=profile)


def _with_grey_profile(profile: bytes) -> bytes:
    return saved("jpeg", "L", icc_profile=profile)


def _profiles() -> tuple[Case, ...]:
    wide, curve = to_d50(P3), parametric_curve(*SRGB_CURVE)
    files = [rgb_profile(wide, curve, version=4), rgb_profile(wide, gamma_curve(2.2))]
    files += [rgb_profile(wide, sampled_curve(np.linspace(0, 1, 30) ** 2)), table_profile()]
    cases = tuple(Case("a.png", data, _photo_of_profile, _with_profile) for data in files)
    grey = grey_profile(gamma_curve(1.8))
    return (*cases, Case("a.jpg", grey, _photo_of_profile, _with_grey_profile))


def _heif() -> tuple[Case, ...]:
    profile = rgb_profile(to_d50(P3), parametric_curve(*SRGB_CURVE))
    files = []
    for pixels, options in ((codes(), {}), (_with_alpha(8), {"icc_profile": profile})):
        stream = io.BytesIO()
        image = pillow_heif.from_pillow(Image.fromarray(pixels))
        image.save(stream, quality=90, exif=_turned(6).tobytes(), **options)
        files.append(Case("a.heic", stream.getvalue(), _photo))
    stream = io.BytesIO()
    pillow_heif.from_bytes("RGB;16", (20, 24), codes(16).tobytes()).save(stream, quality=90)
    avif = Case("a.avif", saved("avif", exif=_turned(6), icc_profile=profile), _photo)
    plain = Case("a.avif", saved("avif"), _photo)
    return (*files, Case("a.heic", stream.getvalue(), _photo), avif, plain)


def _raw() -> tuple[Case, ...]:
    stored = np.rint(mosaic(np.tile(ball(), (2, 2, 1))) * 16383)
    files = (dng(stored), dng(stored, orientation=6, black=512), dng(stored, order=">"))
    return tuple(Case("a.dng", data, _photo) for data in files)


_HEIF_WORDS = words(
    b"ftypheic~mif1~avif~meta~hdlr~pitm~iloc~iinf~infe~iprp~ipco~ipma~ispe~hvcC~colr~nclx~prof~"
    b"irot~imir~pixi~auxC~grid~tmap~idat~mdat"
)
_PROFILE_WORDS = words(b"acsp~RGB ~GRAY~CMYK~XYZ ~curv~para~mluc~desc~mft2~rTRC~rXYZ~A2B0~kTRC")
_RAW_WORDS = (
    *_TIFF_WORDS,
    *words(b"\x12\xc6~\x23\x80~\x25\x88~J\x01~\x1a\xc6~\x1d\xc6~!\xc6~CR\x02"),
)
_PLAIN_WORDS = words(b"BM~P5~P6~P3~#~65535 ~\x28\0\0\0~\x01\0\0\0")
PICTURES = (
    Target("png", _png, _PNG_WORDS),
    Target("jpeg", _jpeg, _JPEG_WORDS),
    Target("tiff", _tiff, _TIFF_WORDS),
    Target("exr", _exr, _EXR_WORDS),
    Target("hdr", _hdr, _HDR_WORDS),
    Target("bmp-ppm", _plain, _PLAIN_WORDS),
    Target("npy", _npy, _NPY_WORDS),
    Target("profile", _profiles, _PROFILE_WORDS),
    Target("heif", _heif, _HEIF_WORDS),
    Target("raw", _raw, _RAW_WORDS),
)
