"""Files as cameras and phones write them: HEIC, AVIF, raw, gain maps, turned and large ones."""

import io
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.io.decoders.raw import is_raw
from isc_core.io.limits import Limits
from isc_core.io.reading_notes import ReadingNote, ReadingNoteKind
from isc_core.photo import WholeFrame, encode_like, read_photo, read_raster
from tests.core.photo.icc_profiles import (
    P3,
    PROPHOTO_XYZ,
    SRGB_CURVE,
    encoded,
    gamma_curve,
    parametric_curve,
    rgb_profile,
    to_d50,
)
from tests.core.photo.raw_files import dng, mosaic

pillow_heif = pytest.importorskip("pillow_heif", reason="needs the extra heic")
pytest.importorskip("rawpy", reason="needs the extra raw")

H, W = 48, 64
DISPLAY_P3 = rgb_profile(to_d50(P3), parametric_curve(*SRGB_CURVE), "Display P3", 4)
NEUTRAL = (0.5, 1.0, 0.7)


def patches(seed: int = 0) -> np.ndarray:
    """(H, W, 3) of linear light in flat squares of 16 pixels, without symmetry."""
    squares = np.random.default_rng(seed).uniform(0.1, 0.6, (H // 16, W // 16, 3))
    return np.repeat(np.repeat(squares, 16, 0), 16, 1).astype(np.float32)


def codes(light: np.ndarray | None = None) -> np.ndarray:
    return np.rint(255 * linear_to_srgb(patches() if light is None else light)).astype(np.uint8)


def heic(path: Path, pixels: np.ndarray, **options: object) -> Path:
    """A HEIC whose colours are not subsampled."""
    image = pillow_heif.from_pillow(Image.fromarray(pixels))
    image.save(path, quality=95, chroma=444, **options)
    return path


def turned(orientation: int) -> bytes:
    exif = Image.Exif()
    exif[0x0112] = orientation
    return exif.tobytes()


def middles(image: np.ndarray) -> np.ndarray:
    """The pixel in the middle of each patch."""
    return image[7::16, 7::16]


def off(image: np.ndarray, truth: np.ndarray) -> float:
    """Largest difference in the middles of the patches, in code values of 8-bit sRGB."""
    shown, true = (linear_to_srgb(middles(values)) for values in (image, truth))
    return 255 * float(np.abs(shown - true).max())


def raw(path: Path, light: np.ndarray, black: int = 512, **options: object) -> Path:
    """A DNG of linear light, as a sensor of the white `NEUTRAL` and 14 bits records it."""
    stored = np.clip(np.rint(mosaic(light * NEUTRAL) * (16383 - black)) + black, 0, 16383)
    path.write_bytes(dng(stored, neutral=NEUTRAL, black=black, **options))
    return path


def refusal(path: Path, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# --- HEIC and AVIF --------------------------------------------------------------------------------


def test_heic(tmp_path: Path) -> None:
    photo = read_photo(heic(tmp_path / "a.heic", codes()), whole_frame=WholeFrame.WITHOUT_MASK)
    assert off(photo.image, patches()) < 3
    source = photo.original
    assert (source.transfer, source.bit_depth, source.size) == ("srgb", 8, (W, H))
    assert source.notes == ()


@pytest.mark.parametrize("kind", ["heic", "avif"])
def test_a_phones_display_p3(tmp_path: Path, kind: str) -> None:
    path, pixels = tmp_path / f"a.{kind}", encoded(patches(), to_d50(P3), None, 255)
    if kind == "heic":
        heic(path, pixels, icc_profile=DISPLAY_P3)
    else:
        Image.fromarray(pixels).save(path, quality=97, subsampling="4:4:4", icc_profile=DISPLAY_P3)
    photo = read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK)
    assert off(photo.image, patches()) < 4 < off(srgb_to_linear(pixels / 255), patches())
    assert photo.original.colour_profile == "Display P3"


def test_more_than_8_bits_of_a_heic_are_kept(tmp_path: Path) -> None:
    ramp = np.rint(np.linspace(0, 1023, W * H).reshape(H, W, 1) * np.ones(3) / 1023 * 65535)
    pixels = ramp.astype(np.uint16)
    pillow_heif.from_bytes("RGB;16", (W, H), pixels.tobytes()).save(tmp_path / "a.heic", quality=-1)
    raster = read_raster(tmp_path / "a.heic")
    assert (raster.bit_depth, raster.peak, raster.values.max()) == (10, 65535, 65535)
    error = raster.values.astype(int) - pixels
    assert np.abs(error).max() < 130 and len(np.unique(raster.values)) > 700
    photo = read_photo(tmp_path / "a.heic", whole_frame=WholeFrame.WITHOUT_MASK)
    assert photo.code_value == pytest.approx(1 / 1023 / 12.92) and photo.clipped[-1, -1].all()


@pytest.mark.parametrize("orientation", [3, 5, 6, 8])
@pytest.mark.parametrize("kind", ["heic", "avif", "tif", "dng"])
def test_a_camera_that_was_turned(tmp_path: Path, kind: str, orientation: int) -> None:
    path = tmp_path / f"a.{kind}"
    upright = {3: patches()[::-1, ::-1], 5: patches().transpose(1, 0, 2)}
    upright |= {6: np.rot90(patches(), -1), 8: np.rot90(patches())}
    if kind == "heic":
        heic(path, codes(), exif=turned(orientation))
    elif kind == "dng":
        raw(path, patches(), orientation=orientation)
    else:
        Image.fromarray(codes()).save(path, quality=97, exif=turned(orientation))
    photo = read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK)
    assert photo.image.shape == upright[orientation].shape
    assert off(photo.image, upright[orientation]) < 5


def test_a_heic_with_transparency_has_a_mask(tmp_path: Path) -> None:
    alpha = np.zeros((H, W, 1), np.uint8)
    alpha[8:40, 8:40] = 255
    path = heic(tmp_path / "a.heic", np.concatenate([codes(), alpha], axis=2))
    photo = read_photo(path)
    assert photo.original.mask_from == "alpha" and photo.mask.sum() == pytest.approx(1024, abs=80)


@pytest.mark.parametrize(
    ("package", "kind", "extra"), [("pillow_heif", "heic", "heic"), ("rawpy", "dng", "raw")]
)
def test_a_missing_package_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, package: str, kind: str, extra: str
) -> None:
    path = tmp_path / f"a.{kind}"
    (heic(path, codes()) if kind == "heic" else raw(path, patches()))
    monkeypatch.setitem(sys.modules, package, None)
    message = refusal(path)
    assert f"needs {package.replace('_', '-')}: install it with `pip install" in message
    assert "save the photo as" in message or "export the photo as" in message


def test_hdr_pictures_and_gain_maps(tmp_path: Path) -> None:
    gain_map = (ReadingNote(ReadingNoteKind.GAIN_MAP),)
    jpeg = io.BytesIO()
    xmp = b'<x:xmpmeta xmlns:x="adobe:ns:meta/" hdrgm:Version="1.0"></x:xmpmeta>'
    Image.fromarray(codes()).save(jpeg, "jpeg", quality=98, xmp=xmp)
    (tmp_path / "a.jpg").write_bytes(jpeg.getvalue())
    photo = read_photo(tmp_path / "a.jpg", whole_frame=WholeFrame.WITHOUT_MASK)
    assert photo.original.notes == gain_map and off(photo.image, patches()) < 5
    data = heic(tmp_path / "a.heic", codes()).read_bytes()
    box = b"\0\0\0\x38freeurn:com:apple:photo:2020:aux:hdrgainmap\0"
    (tmp_path / "b.heic").write_bytes(data + box)
    assert (
        read_photo(tmp_path / "b.heic", whole_frame=WholeFrame.WITHOUT_MASK).original.notes
        == gain_map
    )


def test_damaged_heic_is_refused_in_one_line(tmp_path: Path) -> None:
    data = heic(tmp_path / "a.heic", codes()).read_bytes()
    for cut in (30, 200, len(data) // 2, len(data) - 40):
        (tmp_path / "b.heic").write_bytes(data[:cut])
        assert "b.heic: the HEIC file is damaged" in refusal(tmp_path / "b.heic")
    assert "exceed the limit" in refusal(tmp_path / "a.heic", limits=Limits(max_pixels=1000))


# --- camera raw -----------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["<", ">"])
def test_raw_is_linear_with_the_cameras_white_balance(tmp_path: Path, order: str) -> None:
    photo = read_photo(
        raw(tmp_path / "a.dng", patches(), order=order), whole_frame=WholeFrame.WITHOUT_MASK
    )
    assert middles(photo.image) == pytest.approx(middles(patches()), abs=2e-4)
    source = photo.original
    assert (source.transfer, source.bit_depth, source.notes) == ("linear", 14, ())
    assert photo.code_value == pytest.approx(1 / 16383) and not photo.clipped.any()


def test_the_name_of_a_raw_file_does_not_matter(tmp_path: Path) -> None:
    photo = read_photo(raw(tmp_path / "a.tif", patches()), whole_frame=WholeFrame.WITHOUT_MASK)
    assert photo.original.colour_profile == "camera raw"


def test_saturated_pixels_of_the_sensor_are_clipped(tmp_path: Path) -> None:
    light = patches()
    light[16:32, 16:32, 1] = 1.5  # green alone: red and blue of the picture stay below white
    photo = read_photo(
        raw(tmp_path / "a.dng", light, orientation=6), whole_frame=WholeFrame.WITHOUT_MASK
    )
    expected = np.zeros((H, W), bool)
    expected[16:32, 16:32] = True
    grown = np.zeros((H, W), bool)
    grown[15:33, 15:33] = True
    clipped = np.rot90(photo.clipped)
    assert (clipped >= expected).all() and (clipped <= grown).all()


def test_raw_sizes_are_checked_before_the_pixels_are_unpacked(tmp_path: Path) -> None:
    path = raw(tmp_path / "a.dng", patches(), claimed=(20_000, 30_000))
    assert "30000 x 20000 pixels exceed the limit of 100 megapixels" in refusal(path)


@pytest.mark.parametrize("camera", ["another TIFF", "Fujifilm", "Canon"])
def test_a_raw_of_an_unknown_camera(tmp_path: Path, camera: str) -> None:
    stored = dng(np.random.default_rng(0).integers(0, 16000, (H, W)))
    versions = struct.pack("<H", 50706), struct.pack("<H", 50707)
    bits = struct.pack("<HHII", 258, 3, 1, 16), struct.pack("<HHII", 258, 3, 1, 7)
    files = {
        "another TIFF": stored.replace(*versions).replace(*bits),
        "Fujifilm": b"FUJIFILMCCD-RAW 0201FF" + bytes(4000),
        "Canon": b"\0\0\0\x18ftypcrx \0\0\0\1crx isom" + bytes(4000),
    }
    (tmp_path / "a.raw").write_bytes(files[camera])
    message = refusal(tmp_path / "a.raw")
    assert "of a camera that LibRaw" in message and "convert it to DNG" in message


def test_a_raw_without_the_colours_of_its_camera(tmp_path: Path) -> None:
    photo = read_photo(
        raw(tmp_path / "a.dng", patches(), matrix=None), whole_frame=WholeFrame.WITHOUT_MASK
    )
    assert photo.original.notes == (ReadingNote(ReadingNoteKind.UNKNOWN_CAMERA_COLOURS),)


def test_damaged_raw_is_refused_in_one_line(tmp_path: Path) -> None:
    data = raw(tmp_path / "a.dng", patches()).read_bytes()
    for cut in (100, 300, len(data) // 2):
        (tmp_path / "b.dng").write_bytes(data[:cut])
        assert refusal(tmp_path / "b.dng")


def test_plain_files_are_not_taken_for_raw(tmp_path: Path) -> None:
    for name, options in (("a.tif", {}), ("b.tif", {"compression": "tiff_lzw"}), ("c.jpg", {})):
        Image.fromarray(codes()).save(tmp_path / name, exif=turned(6), **options)
        assert not is_raw((tmp_path / name).read_bytes())
    assert not is_raw(b"II*\0") and not is_raw(b"II*\0" + b"\xff" * 40) and not is_raw(b"")
    looping = b"II*\0\x08\0\0\0" + b"\x01\0" + b"\x4a\x01\x04\0\x01\0\0\0\x08\0\0\0" + b"\x08\0\0\0"
    assert not is_raw(looping)
    assert is_raw(b"\0\0\0\x18ftypcrx \0\0\0\0") and is_raw(b"II*\0\x10\0\0\0CR\x02\0" + bytes(20))


def test_an_edit_of_a_raw_photo_is_srgb(tmp_path: Path) -> None:
    path = raw(tmp_path / "a.dng", patches())
    raster, image = read_raster(path), read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK).image
    changed = np.ones((H, W), bool)
    result = encode_like(raster, "linear", image, changed)
    assert (result.peak, result.space) == (65535, None)
    assert srgb_to_linear(result.values / 65535) == pytest.approx(image, abs=1e-4)


# --- others ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("orientation", [1, 6])
def test_16_bit_prophoto_tiff(tmp_path: Path, orientation: int) -> None:
    import tifffile

    profile = rgb_profile(PROPHOTO_XYZ, gamma_curve(1.8), "ProPhoto RGB")
    pixels = encoded(patches(), PROPHOTO_XYZ, round(256 * 1.8) / 256, 65535)
    tags = [(34675, "B", len(profile), profile, True), (274, "H", 1, orientation, True)]
    tifffile.imwrite(
        tmp_path / "a.tif", pixels, photometric="rgb", extratags=tags, metadata=None,
        compression="adobe_deflate",
    )  # fmt: skip
    photo = read_photo(tmp_path / "a.tif", whole_frame=WholeFrame.WITHOUT_MASK)
    assert off(photo.image, np.rot90(patches(), -1) if orientation == 6 else patches()) < 0.05
    assert (photo.original.colour_profile, photo.original.bit_depth) == ("ProPhoto RGB", 16)


def test_cmyk_is_refused_whatever_its_profile(tmp_path: Path) -> None:
    for name in ("a.jpg", "a.tif"):
        Image.fromarray(codes()).convert("CMYK").save(tmp_path / name, icc_profile=DISPLAY_P3)
        assert "CMYK colours are not supported: convert it to RGB" in refusal(tmp_path / name)


@pytest.mark.slow
def test_a_50_megapixel_jpeg_just_works(tmp_path: Path) -> None:
    y, x = np.ogrid[:765, :1020]
    high = np.sqrt(np.maximum(1 - ((x - 500) / 312.0) ** 2 - ((y - 375) / 312.0) ** 2, 0))
    red = (230 * high).astype(np.uint8)
    pixels = Image.fromarray(np.stack([red, red // 2, red // 3], axis=2))
    exif = Image.Exif()
    exif[0x0112] = 6
    path = tmp_path / "a.jpg"
    large = pixels.resize((8160, 6120), Image.Resampling.NEAREST)
    large.save(path, quality=85, exif=exif, icc_profile=DISPLAY_P3)
    photo = read_photo(path)
    assert photo.original.size == (6120, 8160) and photo.original.mask_from == "black border"
    small = photo.resized_to_object(256)
    assert max(small.box[2:]) == 256 and small.image[small.mask].max() > 0.5
