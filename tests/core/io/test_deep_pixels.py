"""PNG, TIFF and HDR of more than 8 bits a channel: the values that other programs stored."""

import itertools
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isc_core.errors import InputError
from isc_core.io.decoders import read_raster
from isc_core.io.decoders.png import write_png
from isc_core.io.png import SIGNATURE, decode_png, encode_png, png_chunk

CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}
PASSES = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4)]
PASSES += [(0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]


def samples(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 65536, shape).astype(np.uint16)


def filtered(rows: np.ndarray, step: int) -> bytes:
    """Rows (H, N) uint8 of a PNG, filtered one after the other in the five ways."""
    out, above = [], np.zeros(rows.shape[1], int)
    for number, row in enumerate(rows.astype(int)):
        left, corner = (np.concatenate([np.zeros(step, int), x[:-step]]) for x in (row, above))
        guess = left + above - corner
        far = [abs(guess - x) for x in (left, above, corner)]
        paeth = np.where((far[0] <= far[1]) & (far[0] <= far[2]), left, above)
        paeth = np.where((far[0] > far[2]) & (far[1] > far[2]), corner, paeth)
        taken = [0 * row, left, above, (left + above) // 2, paeth][number % 5]
        out.append(bytes([number % 5]) + ((row - taken) % 256).astype(np.uint8).tobytes())
        above = row
    return b"".join(out)


def png(values: np.ndarray, kind: int, interlaced: bool) -> bytes:
    """A PNG of 16 bits (H, W, C), made without the libraries under test."""
    parts = PASSES if interlaced else [(0, 0, 1, 1)]
    planes = [values[y::down, x::across] for x, y, across, down in parts]
    step = 2 * CHANNELS[kind]
    lines = b"".join(
        filtered(np.frombuffer(p.astype(">u2").tobytes(), np.uint8).reshape(len(p), -1), step)
        for p in planes
        if p.size
    )
    size = struct.pack(">IIBBBBB", values.shape[1], values.shape[0], 16, kind, 0, 0, interlaced)
    chunks = ((b"IHDR", size), (b"IDAT", zlib.compress(lines)), (b"IEND", b""))
    return SIGNATURE + b"".join(png_chunk(*chunk) for chunk in chunks)


@pytest.mark.parametrize("interlaced", [False, True])
@pytest.mark.parametrize("kind", CHANNELS)
def test_a_png_of_16_bits_is_read_with_every_filter(
    tmp_path: Path, kind: int, interlaced: bool
) -> None:
    stored = samples(23, 17, CHANNELS[kind])
    path = tmp_path / "a.png"
    path.write_bytes(png(stored, kind, interlaced))
    raster = read_raster(path)
    colours = stored if kind in (0, 2) else stored[..., :-1]
    assert (raster.values == colours).all()
    if kind in (4, 6):
        assert raster.alpha == pytest.approx(stored[..., -1] / 65535, abs=1e-6)


def test_a_png_whose_pixels_end_early_is_damaged(tmp_path: Path) -> None:
    data = png(samples(20, 17, 3), 2, False)
    longer = struct.pack(">IIBBBBB", 17, 21, 16, 2, 0, 0, 0)
    path = tmp_path / "a.png"
    path.write_bytes(data[:8] + png_chunk(b"IHDR", longer) + data[33:])
    with pytest.raises(InputError, match="PNG file is damaged"):
        read_raster(path)


@pytest.mark.parametrize("before", [33, -12])  # behind IHDR, or between the pixels and IEND
def test_a_png_of_16_bits_is_turned_upright(tmp_path: Path, before: int) -> None:
    exif, stored = Image.Exif(), samples(20, 17, 3)
    exif[0x0112] = 6  # turned by a quarter
    chunk = png_chunk(b"eXIf", exif.tobytes().removeprefix(b"Exif\0\0"))
    data, path = png(stored, 2, False), tmp_path / "a.png"
    path.write_bytes(data[:before] + chunk + data[before:])
    assert (read_raster(path).values == np.rot90(stored, -1)).all()


def test_a_png_with_an_unknown_filter_is_damaged(tmp_path: Path) -> None:
    data, lines = png(samples(20, 17, 3), 2, False), np.full((20, 1 + 6 * 17), 5, np.uint8)
    path = tmp_path / "a.png"
    path.write_bytes(data[:33] + png_chunk(b"IDAT", zlib.compress(lines.tobytes())) + data[-12:])
    with pytest.raises(InputError, match="PNG file is damaged"):
        read_raster(path)


@pytest.mark.parametrize("compression", [1, 6])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_other_programs_read_the_png(channels: int, kind: type, compression: int) -> None:
    cv2 = pytest.importorskip("cv2")
    stored: np.ndarray = samples(12, 9, channels).astype(kind)
    data = encode_png(stored, compression)
    seen = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    order = [2, 1, 0, 3][:channels] if channels > 1 else [0]
    assert (seen.reshape(stored.shape)[..., order] == stored).all()


def _options() -> list[tuple[str, bool, bool]]:
    packed = [("none", False), ("zlib", False), ("zlib", True), ("lzma", False)]
    return [(*one, tiled) for one in packed for tiled in (False, True)]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", ["u2", "f2", "f4"])
@pytest.mark.parametrize(("packed", "predicted", "tiled"), _options())
def test_tiff_of_tifffile(
    tmp_path: Path, order: str, kind: str, packed: str, predicted: bool, tiled: bool
) -> None:
    tifffile = pytest.importorskip("tifffile")
    predicted &= kind == "u2"  # tifffile alone does not write that of floats
    stored = (samples(37, 41, 3) // 2).astype(kind)
    options: dict[str, object] = {"tile": (16, 32)} if tiled else {"rowsperstrip": 7}
    options |= {"compression": packed, "predictor": predicted, "byteorder": order}
    for planar in ("contig", "separate"):
        pixels = stored if planar == "contig" else np.moveaxis(stored, 2, 0).copy()
        tifffile.imwrite(
            tmp_path / "a.tif", pixels, photometric="rgb", planarconfig=planar, **options
        )
        assert (read_raster(tmp_path / "a.tif").values == stored).all()


@pytest.mark.parametrize("kind", ["u2", "f4", "f8"])
def test_tiff_of_libtiff(tmp_path: Path, kind: str) -> None:
    """Also LZW, PackBits and the predictor of floats, and the orientation."""
    cv2 = pytest.importorskip("cv2")
    stored = np.cumsum(samples(37, 41, 3), axis=1).astype(kind)
    packing = itertools.product((1, 5, 8, 32773), (1, 2, 3))
    for compression, predictor in packing:
        if predictor > 1 and (compression not in (5, 8) or (predictor == 3 and kind == "u2")):
            continue
        choices = (cv2.IMWRITE_TIFF_COMPRESSION, compression, cv2.IMWRITE_TIFF_PREDICTOR, predictor)
        assert cv2.imwrite(str(tmp_path / "a.tif"), stored[..., ::-1], choices)
        values = read_raster(tmp_path / "a.tif").values
        assert (values == stored.astype(values.dtype)).all(), (compression, predictor)


def test_tiff_is_turned_upright(tmp_path: Path) -> None:
    cv2, tifffile = pytest.importorskip("cv2"), pytest.importorskip("tifffile")
    for orientation in range(1, 9):
        tag = [(274, "H", 1, orientation, True)]
        tifffile.imwrite(tmp_path / "a.tif", samples(20, 31, 3), photometric="rgb", extratags=tag)
        data = np.fromfile(tmp_path / "a.tif", np.uint8)
        other = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)[..., ::-1]
        values = read_raster(tmp_path / "a.tif").values
        assert values.shape == other.shape and (values == other).all()


def test_tiles_without_end_are_refused(tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile")
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, samples(20, 31, 3), photometric="rgb", tile=(16, 32), compression="zlib")
    data = path.read_bytes()
    wide = data.replace(struct.pack("<HHI", 322, 3, 1), struct.pack("<HHI", 322, 4, 1))
    at = wide.index(struct.pack("<HHI", 322, 4, 1)) + 8
    path.write_bytes(wide[:at] + struct.pack("<I", 1 << 20) + wide[at + 4 :])
    with pytest.raises(InputError, match="TIFF file is damaged"):
        read_raster(path)


@pytest.mark.parametrize("width", [30, 7 + 8])
def test_radiance_hdr_has_the_values_of_another_reader(tmp_path: Path, width: int) -> None:
    cv2 = pytest.importorskip("cv2")
    light = np.exp(np.random.default_rng(0).normal(0, 5, (24, width, 3))).astype(np.float32)
    light[:, 4:13] = light[:, 4:5]  # runs
    light[3] = 0
    for compression in (cv2.IMWRITE_HDR_COMPRESSION_NONE, cv2.IMWRITE_HDR_COMPRESSION_RLE):
        path = tmp_path / "a.hdr"
        assert cv2.imwrite(str(path), light, (cv2.IMWRITE_HDR_COMPRESSION, compression))
        other = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]
        assert (read_raster(path).values == other).all()


@pytest.mark.parametrize("shape", [(7, 5), (7, 5, 3), (7, 5, 4)])
def test_a_png_is_decoded_as_it_was_encoded(shape: tuple[int, ...]) -> None:
    codes = np.random.default_rng(2).integers(0, 256, shape).astype(np.uint8)
    np.testing.assert_array_equal(decode_png(encode_png(codes)), codes)
    with pytest.raises(ValueError, match="another kind"):
        decode_png(encode_png(codes.astype(np.uint16)))


@pytest.mark.parametrize("peak", [1000, 1023, 4095])
def test_codes_of_a_smaller_peak_are_scaled_to_that_of_a_png(tmp_path: Path, peak: int) -> None:
    stored = (samples(12, 9, 3) % (peak + 1)).astype(">u2")
    stored[0, 0], stored[0, 1] = 0, peak
    (tmp_path / "a.ppm").write_bytes(b"P6 9 12 %d\n" % peak + stored.tobytes())
    write_png(tmp_path / "a.png", read_raster(tmp_path / "a.ppm"))
    written = read_raster(tmp_path / "a.png")
    assert (written.values[0, :2] == [[0] * 3, [65535] * 3]).all()
    assert np.abs(written.values / 65535 - stored / peak).max() < 1e-5
