"""Reading photos: exact values from every kind of file, the mask's rules, resizing in linear light,
and one clear line for bad input.
"""

import io
import os
import struct
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.imaging.bounding_box import mask_box
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.io.limits import Limits
from isc_core.photo import (
    Photo,
    PhotoSource,
    WholeFrame,
    read_linear,
    read_photo,
    read_raster,
    tidy_mask,
)

H, W = 40, 52


def object_mask(h: int = H, w: int = W) -> np.ndarray:
    """An ellipse that leaves a border free."""
    y, x = np.mgrid[:h, :w]
    return ((x - w / 2) / (0.4 * w)) ** 2 + ((y - h / 2) / (0.35 * h)) ** 2 < 1


def codes(peak: int = 255, channels: int = 3, seed: int = 0) -> np.ndarray:
    """Random codes from 1/4 of `peak` upward on the object, without symmetry; black outside."""
    values = np.random.default_rng(seed).integers(peak // 4, peak, (H, W, channels), endpoint=True)
    return np.where(object_mask()[..., None], values, 0).astype(
        np.uint8 if peak < 256 else np.uint16
    )


def png(values: np.ndarray, bits: int, colour: int, extra: bytes = b"") -> bytes:
    """A PNG of our own making, independent of the libraries under test:

    (H, W, C) codes of 8 or 16 bits.
    """
    rows = b"".join(
        b"\0" + row.astype(">u2" if bits == 16 else np.uint8).tobytes() for row in values
    )
    header = struct.pack(">IIBBBBB", values.shape[1], values.shape[0], bits, colour, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + extra
        + chunk(b"IDAT", zlib.compress(rows))
        + chunk(b"IEND", b"")
    )


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_exr(path: Path, channels: dict[str, np.ndarray], **header: object) -> Path:
    OpenEXR.File(
        header, {name: np.ascontiguousarray(plane) for name, plane in channels.items()}
    ).write(str(path))
    return path


def write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def saved(path: Path, image: Image.Image, **options: Any) -> Path:
    image.save(path, **options)
    return path


def arrayed(path: Path, values: np.ndarray) -> Path:
    np.save(path, values)
    return path


def opencv(path: Path, rgb: np.ndarray, *options: int) -> Path:
    assert cv2.imwrite(
        str(path), rgb[..., [2, 1, 0, 3][: rgb.shape[2]]] if rgb.ndim == 3 else rgb, options
    )
    return path


def refused(path: Path, *words: str, mask: Path | None = None, transfer: str = "auto") -> None:
    """The photo is refused in one line that holds all the words."""
    with pytest.raises(InputError) as caught:
        read_photo(path, mask, transfer)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


# --- the curve ------------------------------------------------------------------------------------


def test_srgb_curve_has_the_standard_values() -> None:
    assert srgb_to_linear(np.array([0.0, 1.0])) == pytest.approx([0, 1], abs=1e-12)
    assert float(srgb_to_linear(128 / 255)) == pytest.approx(0.2158605, abs=1e-6)
    assert float(srgb_to_linear(10 / 255)) == pytest.approx(10 / 255 / 12.92, rel=1e-12)


@given(st.floats(0, 4))
def test_srgb_curve_is_inverted(x: float) -> None:
    assert float(srgb_to_linear(linear_to_srgb(x))) == pytest.approx(x, rel=2e-6, abs=1e-9)


# --- exact values from every kind of file ---------------------------------------------------------


def test_8_bit_png_is_decoded_by_the_srgb_curve(tmp_path: Path) -> None:
    stored = codes()
    photo = read_photo(write(tmp_path / "a.png", png(stored, 8, 2)))
    assert photo.image.dtype == np.float32 and photo.image.shape == (H, W, 3)
    assert photo.image == pytest.approx(srgb_to_linear(stored / 255), abs=1e-7)
    assert (photo.mask == object_mask()).all()
    assert (photo.clipped == (stored == 255).any(axis=2)).all() and photo.clipped.any()
    assert photo.code_value == pytest.approx(1 / 255 / 12.92)
    assert photo.scale == 1 and photo.original.size == (W, H)
    assert (photo.original.bit_depth, photo.original.transfer, photo.original.mask_from) == (
        8,
        "srgb",
        "black border",
    )
    assert len(photo.original.sha256) == 64


@pytest.mark.parametrize("colour", [0, 2, 4, 6])
def test_16_bit_png_is_read_in_full(tmp_path: Path, colour: int) -> None:
    channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
    stored = codes(65535, channels)
    photo = read_photo(write(tmp_path / "a.png", png(stored, 16, colour)), transfer="linear")
    colours = stored[..., : channels - (channels in (2, 4))]
    assert photo.image == pytest.approx(np.broadcast_to(colours / 65535, (H, W, 3)), abs=1e-7)
    assert len(np.unique(photo.image)) > 700  # 8 bits have no more than 256
    assert photo.code_value == pytest.approx(1 / 65535) and photo.original.bit_depth == 16


def test_16_bit_png_is_srgb_by_default(tmp_path: Path) -> None:
    stored = codes(65535)
    path = write(tmp_path / "a.png", png(stored, 16, 2))
    assert read_photo(path).image == pytest.approx(srgb_to_linear(stored / 65535), abs=1e-7)
    assert read_photo(path).original.transfer == "srgb"
    assert read_photo(path).code_value == pytest.approx(1 / 65535 / 12.92)


def test_eight_bit_kinds_of_png_agree(tmp_path: Path) -> None:
    grey = codes(channels=1)[..., 0]
    grey[grey > 0] = grey[grey > 0] // 16 * 16
    rgb = np.repeat(grey[..., None], 3, axis=2)
    opaque = np.full_like(grey, 255)
    images = {
        "rgb": Image.fromarray(rgb),
        "grey": Image.fromarray(grey),
        "grey_alpha": Image.fromarray(np.stack([grey, opaque], axis=2), "LA"),
        "rgba": Image.fromarray(np.dstack([rgb, opaque])),
        "palette": Image.fromarray(rgb).convert("P", palette=Image.Palette.ADAPTIVE, colors=64),
    }
    for name, image in images.items():
        photo = read_photo(saved(tmp_path / f"{name}.png", image))
        assert photo.image == pytest.approx(srgb_to_linear(rgb / 255), abs=1e-7), name
        assert (photo.mask == object_mask()).all(), name


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("colour", [0, 2])
def test_a_transparent_colour_of_a_png_is_the_background(
    tmp_path: Path, bits: int, colour: int
) -> None:
    peak, channels = 2**bits - 1, 3 if colour else 1
    stored = np.where(object_mask()[..., None], codes(peak, channels) // 2, peak)
    clear = chunk(b"tRNS", struct.pack(f">{channels}H", *[peak] * channels))
    path = write(tmp_path / "a.png", png(stored, bits, colour, clear))
    photo = read_photo(path, transfer="linear")
    assert photo.original.mask_from == "alpha" and (photo.mask == object_mask()).all()
    inside = np.broadcast_to(stored / peak, (H, W, 3))[object_mask()]
    assert photo.image[object_mask()] == pytest.approx(inside, abs=1e-7)


def test_one_bit_png_as_a_mask(tmp_path: Path) -> None:
    photo = write(tmp_path / "a.png", png(codes() + 9, 8, 2))
    mask = saved(tmp_path / "m.png", Image.fromarray(object_mask()))
    assert Image.open(mask).mode == "1"
    assert (read_photo(photo, mask).mask == object_mask()).all()
    refused(
        saved(tmp_path / "b.png", Image.fromarray(object_mask())),
        "every pixel inside the mask is the same",
    )


@pytest.mark.parametrize("name", ["a.bmp", "a.ppm", "a.tif", "lzw.tif"])
def test_other_lossless_8_bit_files(tmp_path: Path, name: str) -> None:
    stored = codes()
    options = {"compression": "tiff_lzw"} if name == "lzw.tif" else {}
    photo = read_photo(saved(tmp_path / name, Image.fromarray(stored), **options))
    assert photo.image == pytest.approx(srgb_to_linear(stored / 255), abs=1e-7)


def test_jpeg(tmp_path: Path) -> None:
    smooth = cv2.GaussianBlur(codes(), (0, 0), 3) // 2 + 60
    mask = saved(tmp_path / "m.png", Image.fromarray(object_mask()))
    photo = read_photo(
        saved(tmp_path / "a.jpg", Image.fromarray(smooth), quality=98, subsampling=0), mask
    )
    assert np.abs(linear_to_srgb(photo.image) * 255 - smooth).max() < 6
    grey = read_photo(saved(tmp_path / "g.jpg", Image.fromarray(smooth[..., 0]), quality=98), mask)
    assert (grey.image[..., 0] == grey.image[..., 2]).all()


def test_black_background_of_a_jpeg(tmp_path: Path) -> None:
    y, x = np.mgrid[:200, :220]
    stored = np.where(
        object_mask(200, 220), 90 + 40 * np.sin(x / 30) + 30 * np.cos(y / 25), 0
    ).astype(np.uint8)
    photo = read_photo(
        saved(tmp_path / "a.jpg", Image.fromarray(np.dstack([stored] * 3)), quality=90)
    )
    wrong = photo.mask ^ object_mask(200, 220)
    assert not wrong[cv2.erode(object_mask(200, 220).astype(np.uint8), np.ones((3, 3))) > 0].any()
    assert not wrong[
        cv2.dilate(object_mask(200, 220).astype(np.uint8), np.ones((17, 17))) == 0
    ].any()


@pytest.mark.parametrize("peak", [1023, 4095, 65535])
@pytest.mark.parametrize("channels", [1, 3])
def test_16_bit_pnm_uses_the_stated_maximum(tmp_path: Path, peak: int, channels: int) -> None:
    stored = codes(peak, channels)
    header = f"P{5 if channels == 1 else 6}\n# a comment\n{W} {H}\n{peak}\n".encode()
    photo = read_photo(
        write(tmp_path / "a.ppm", header + stored.astype(">u2").tobytes()), transfer="linear"
    )
    assert photo.image == pytest.approx(np.broadcast_to(stored / peak, (H, W, 3)), abs=1e-7)
    assert photo.code_value == pytest.approx(1 / peak)
    assert (photo.clipped == (stored == peak).any(axis=2)).all()
    refused(write(tmp_path / "b.ppm", header + stored.astype(">u2").tobytes()[:-3]), "damaged")


def test_16_bit_and_float_tiff(tmp_path: Path) -> None:
    stored = codes(65535)
    photo = read_photo(opencv(tmp_path / "a.tif", stored), transfer="linear")
    assert photo.image == pytest.approx(stored / 65535, abs=1e-7) and photo.original.bit_depth == 16
    grey = read_photo(opencv(tmp_path / "g.tif", stored[..., 0]), transfer="linear")
    assert grey.image[..., 1] == pytest.approx(stored[..., 0] / 65535, abs=1e-7)
    light = (stored / 9999).astype(np.float32)
    photo = read_photo(opencv(tmp_path / "f.tif", light, cv2.IMWRITE_TIFF_COMPRESSION, 1))
    assert (
        (photo.image == light).all()
        and photo.original.transfer == "linear"
        and not photo.clipped.any()
    )
    with_alpha = np.dstack([stored, np.where(object_mask(), 65535, 0).astype(np.uint16)])
    assert read_photo(opencv(tmp_path / "r.tif", with_alpha)).original.mask_from == "alpha"


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_the_fourth_channel_of_a_tiff_is_alpha_if_the_file_says_so(
    tmp_path: Path, kind: type
) -> None:
    import tifffile

    peak = 1 if kind is np.float32 else np.iinfo(kind).max
    stored = np.dstack([0.6 * codes(255) + 50, np.where(object_mask(), 255, 0)]) / 255 * peak
    for extra, source in (("unassalpha", "alpha"), ("unspecified", "whole frame")):
        path = tmp_path / f"{extra}.tif"
        tifffile.imwrite(path, stored.astype(kind), photometric="rgb", extrasamples=[extra])
        assert read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK).original.mask_from == source


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_exr(tmp_path: Path, kind: type) -> None:
    light: np.ndarray = (codes(65535) / 20000).astype(kind)
    photo = read_photo(
        write_exr(tmp_path / "a.exr", {c: light[..., i] for i, c in enumerate("RGB")})
    )
    assert (photo.image == light.astype(np.float32)).all()
    assert (photo.mask == object_mask()).all() and not photo.clipped.any()
    assert (
        photo.original.bit_depth == 8 * np.dtype(kind).itemsize
        and photo.original.transfer == "linear"
    )
    grey = read_photo(write_exr(tmp_path / "y.exr", {"Y": light[..., 0]}))
    assert (grey.image == light[..., :1].astype(np.float32)).all()


def test_the_exposure_of_an_exr_does_not_matter(tmp_path: Path) -> None:
    light = (codes(65535) / 65535).astype(np.float32)
    photos = [
        read_photo(
            write_exr(tmp_path / "a.exr", {c: k * light[..., i] for i, c in enumerate("RGB")})
        )
        for k in (2.0**-9, 2.0**9)
    ]
    assert (photos[0].mask == photos[1].mask).all()
    assert photos[1].code_value == pytest.approx(2.0**18 * photos[0].code_value)


def test_layers_of_an_exr(tmp_path: Path) -> None:
    light = (codes(65535) / 65535).astype(np.float32)
    one = {f"beauty.{c}": light[..., i] for i, c in enumerate("RGB")} | {"depth.Z": light[..., 0]}
    assert (read_photo(write_exr(tmp_path / "a.exr", one)).image == light).all()
    two = one | {f"diffuse.{c}": 0 * light[..., i] for i, c in enumerate("RGB")}
    refused(write_exr(tmp_path / "b.exr", two), "beauty", "diffuse")
    top = two | {c: 2 * light[..., i] for i, c in enumerate("RGB")}
    assert (read_photo(write_exr(tmp_path / "c.exr", top)).image == 2 * light).all()
    refused(
        write_exr(tmp_path / "d.exr", {"U": light[..., 0], "V": light[..., 1]}), "R, G, B", "U, V"
    )
    parts = [
        OpenEXR.Part({}, {"RGB": light}, "left"),
        OpenEXR.Part({}, {"Z": light[..., 0].copy()}, "depth"),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "e.exr"))
    assert (read_photo(tmp_path / "e.exr").image == light).all()


def test_the_colours_of_an_exr_are_divided_by_alpha(tmp_path: Path) -> None:
    light = np.random.default_rng(0).uniform(0.2, 1, (H, W, 3)).astype(np.float32)
    alpha = np.where(object_mask(), np.float32(0.75), np.float32(0.25))
    channels = {c: light[..., i] * alpha for i, c in enumerate("RGB")} | {"A": alpha}
    photo = read_photo(write_exr(tmp_path / "a.exr", channels))
    assert photo.image == pytest.approx(light, rel=1e-6) and (photo.mask == object_mask()).all()


def test_an_exr_fills_its_display_window(tmp_path: Path) -> None:
    light = (codes(65535) / 65535).astype(np.float32)
    window = (np.array([5, 3], np.int32), np.array([5 + W - 1, 3 + H - 1], np.int32))
    frame = (np.array([0, 0], np.int32), np.array([69, 59], np.int32))
    channels = {c: light[..., i] for i, c in enumerate("RGB")}
    photo = read_photo(
        write_exr(tmp_path / "a.exr", channels, dataWindow=window, displayWindow=frame)
    )
    assert photo.image.shape == (60, 70, 3)
    assert (photo.image[3 : 3 + H, 5 : 5 + W] == light).all() and photo.image[:3].max() == 0


def test_radiance_hdr(tmp_path: Path) -> None:
    light = (codes(65535) / 9000).astype(np.float32)
    photo = read_photo(opencv(tmp_path / "a.hdr", light))
    assert np.abs(photo.image - light).max() < light.max() / 128
    assert photo.original.transfer == "linear" and (photo.mask == object_mask()).all()


def test_numpy_arrays(tmp_path: Path) -> None:
    """Floats are linear light, integers are codes, the fourth channel is alpha, not multiplied in;
    the order in memory does not matter.
    """
    stored = codes()
    light = srgb_to_linear(stored / 255)
    mask = arrayed(tmp_path / "mask.npy", object_mask())
    for kind in (np.float32, np.float64, ">f4"):
        photo = read_photo(arrayed(tmp_path / "a.npy", light.astype(kind)), mask)
        assert np.array_equal(photo.image, light.astype(np.float32)) and np.array_equal(
            photo.mask, object_mask()
        )
        assert (photo.original.transfer, photo.original.bit_depth) == (
            "linear",
            32,
        ) and not photo.clipped.any()
    png_photo = read_photo(write(tmp_path / "a.png", png(stored, 8, 2)), mask)
    photo = read_photo(arrayed(tmp_path / "codes.npy", np.asfortranarray(stored)), mask)
    assert np.array_equal(photo.image, png_photo.image) and (
        photo.original.transfer,
        photo.original.bit_depth,
    ) == ("srgb", 8)
    assert read_raster(arrayed(tmp_path / "16.npy", stored.astype(np.uint16))).peak == 65535
    alpha = np.where(object_mask(), 1.0, 0.25)
    photo = read_photo(arrayed(tmp_path / "rgba.npy", np.dstack([light, alpha])))
    assert np.array_equal(photo.mask, object_mask()) and np.array_equal(
        photo.image, light.astype(np.float32)
    )


def test_masks_as_numpy_arrays(tmp_path: Path) -> None:
    photo = arrayed(tmp_path / "photo.npy", srgb_to_linear(codes() / 255))
    for values in (object_mask(), 0.8 * object_mask(), object_mask()[..., None] * np.uint8(1)):
        assert np.array_equal(
            read_photo(photo, arrayed(tmp_path / "mask.npy", values)).mask, object_mask()
        )


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.zeros((20, 20, 2)), "(20, 20, 2): a photo is"),
        (np.zeros(20), "(20,): a photo is"),
        (np.zeros((20, 20, 3), np.int64), "values of type int64"),
        (np.zeros((20, 20, 3), complex), "values of type complex128"),
        (np.zeros((20, 20), "U4"), "values of type <U4"),
        (np.zeros((4, 20, 3)), "20 x 4 pixels"),
        (np.zeros((20, 20, 3)), "black"),
        (np.full((20, 20, 3), np.nan), "black"),
    ],
)
def test_numpy_arrays_that_are_no_photos(tmp_path: Path, values: np.ndarray, words: str) -> None:
    refused(arrayed(tmp_path / "a.npy", values), words)


def test_a_numpy_file_with_a_false_header_is_rejected(tmp_path: Path) -> None:
    def header_only(*shape: int) -> Path:
        stream = io.BytesIO()
        np.lib.format.write_array_header_1_0(
            stream, {"descr": "<f4", "fortran_order": False, "shape": shape}
        )
        return write(tmp_path / "a.npy", stream.getvalue() + bytes(64))

    refused(header_only(9_000, 9_000, 3), "damaged")
    refused(header_only(20_000, 20_000, 3), "100 megapixels")
    whole = arrayed(tmp_path / "b.npy", srgb_to_linear(codes() / 255)).read_bytes()
    refused(write(tmp_path / "c.npy", whole.replace(b"'descr'", b"'other'")), "damaged")
    np.save(tmp_path / "d.npy", np.empty((20, 20), object))
    refused(tmp_path / "d.npy", "values of type object")


def test_transfer_can_be_forced(tmp_path: Path) -> None:
    stored = codes()
    path = write(tmp_path / "a.png", png(stored, 8, 2))
    linear = read_photo(path, transfer="linear")
    assert linear.image == pytest.approx(
        stored / 255, abs=1e-7
    ) and linear.code_value == pytest.approx(1 / 255)
    coded = (stored / 255).astype(np.float32)
    exr = write_exr(tmp_path / "a.exr", {c: coded[..., i] for i, c in enumerate("RGB")})
    assert read_photo(exr, transfer="srgb").image == pytest.approx(srgb_to_linear(coded), abs=1e-6)
    refused(path, "--transfer gamma", "srgb", transfer="gamma")


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", ["jpg", "png", "png16", "tif", "tif16"])
def test_rotation_flags_are_applied(tmp_path: Path, kind: str, orientation: int) -> None:
    upright = np.full((48, 64, 3), 9, np.uint8)
    upright[:24, :32], upright[:24, 32:], upright[24:, :32] = (
        (200, 30, 30),
        (30, 200, 30),
        (30, 30, 200),
    )
    undo = {
        1: lambda a: a,
        2: lambda a: a[:, ::-1],
        3: lambda a: a[::-1, ::-1],
        4: lambda a: a[::-1],
        5: lambda a: a.transpose(1, 0, 2),
        6: lambda a: a.transpose(1, 0, 2)[::-1],
        7: lambda a: a.transpose(1, 0, 2)[::-1, ::-1],
        8: lambda a: a.transpose(1, 0, 2)[:, ::-1],
    }[orientation]
    stored = np.ascontiguousarray(undo(upright))
    path = tmp_path / f"a.{kind}"
    exif = Image.Exif()
    exif[0x0112] = orientation
    if kind == "png16":
        write(
            path,
            png(
                stored.astype(np.uint16) * 257,
                16,
                2,
                chunk(b"eXIf", exif.tobytes().removeprefix(b"Exif\0\0")),
            ),
        )
    elif kind == "tif16":
        write(path, tiff_16(stored.astype(np.uint16) * 257, orientation))
    else:
        form = {"jpg": "JPEG", "png": "PNG", "tif": "TIFF"}[kind]
        options = {"quality": 95, "subsampling": 0} if kind == "jpg" else {}
        Image.fromarray(stored).save(path, form, exif=exif, **options)
    image = read_linear(path)
    assert image.shape == upright.shape
    assert np.abs(linear_to_srgb(image) * 255 - upright).max() < 9


def tiff_16(values: np.ndarray, orientation: int) -> bytes:
    """A little-endian TIFF of one strip, with a rotation flag."""
    h, w, channels = values.shape
    pixels = values.astype("<u2").tobytes()
    bits_at = 8 + len(pixels)
    tags = [
        (256, 4, 1, w),
        (257, 4, 1, h),
        (258, 3, 3, bits_at),
        (259, 3, 1, 1),
        (262, 3, 1, 2),
        (273, 4, 1, 8),
    ]
    tags += [
        (274, 3, 1, orientation),
        (277, 3, 1, channels),
        (278, 4, 1, h),
        (279, 4, 1, len(pixels)),
        (284, 3, 1, 1),
    ]
    directory = (
        struct.pack("<H", len(tags))
        + b"".join(struct.pack("<HHII", *tag) for tag in tags)
        + bytes(4)
    )
    return (
        b"II*\0"
        + struct.pack("<I", bits_at + 6)
        + pixels
        + struct.pack("<HHH", 16, 16, 16)
        + directory
    )


# --- the mask -------------------------------------------------------------------------------------


@pytest.mark.parametrize("inside", [1, 128, 255])
def test_a_mask_file_of_any_brightness(tmp_path: Path, inside: int) -> None:
    photo = write(tmp_path / "a.png", png(codes() + 7, 8, 2))
    mask = saved(
        tmp_path / "m.png", Image.fromarray(np.where(object_mask(), inside, 0).astype(np.uint8))
    )
    result = read_photo(photo, mask)
    assert (result.mask == object_mask()).all() and result.original.mask_from == "file"
    assert result.image[0, 0, 0] > 0  # the photo keeps its background


def test_masks_of_other_kinds(tmp_path: Path) -> None:
    photo = write(tmp_path / "a.png", png(codes() + 7, 8, 2))
    inside = object_mask()
    soft = np.where(inside, 0.9, 0.3).astype(np.float32)
    clear = np.dstack([np.zeros((H, W, 3), np.uint8), np.where(inside, 255, 0).astype(np.uint8)])
    files = [
        write(tmp_path / "16.png", png(np.where(inside, 65025, 0)[..., None], 16, 0)),
        write_exr(tmp_path / "m.exr", {"mask.A": soft}),
        saved(tmp_path / "black_on_clear.png", Image.fromarray(clear)),
        saved(
            tmp_path / "palette.png",
            Image.fromarray(np.where(inside, 128, 0).astype(np.uint8)).convert("P"),
        ),
    ]
    for file in files:
        assert (read_photo(photo, file).mask == inside).all(), file.name


def test_the_cover_of_a_soft_mask_or_alpha_channel_is_kept(tmp_path: Path) -> None:
    inside = object_mask()
    ramp = np.clip(ndimage.distance_transform_edt(inside) / 4, 0, 1)
    photo = write(tmp_path / "a.png", png(codes() + 7, 8, 2))
    grey = saved(tmp_path / "m.png", Image.fromarray(np.rint(200 * ramp).astype(np.uint8)))
    clear = np.dstack([codes() + 7, np.rint(255 * ramp).astype(np.uint8)])
    for read in (read_photo(photo, grey), read_photo(saved(tmp_path / "b.png", _image(clear)))):
        assert read.cover is not None
        assert np.abs(read.cover - ramp).max() < 0.004
        sure = np.abs(ramp - 0.5) > 0.01
        assert ((read.cover >= 0.5) == read.mask)[sure].all()


def test_a_hard_mask_or_one_that_is_nowhere_black_has_no_cover(tmp_path: Path) -> None:
    photo, inside = write(tmp_path / "a.png", png(codes() + 7, 8, 2)), object_mask()
    for name, values in (
        ("hard", np.where(inside, 255, 0)),
        ("noisy", np.where(inside, 253, 2)),
        ("grey", np.where(inside, 230, 80)),
    ):
        mask = saved(tmp_path / f"{name}.png", _image(values.astype(np.uint8)))
        assert read_photo(photo, mask).cover is None, name


def test_the_background_is_taken_out_of_a_soft_mask_alone(tmp_path: Path) -> None:
    """A grey disc before blue; the mask is an outline, or fades over its outer third."""
    row, column = np.indices((120, 120)) - 60
    away = np.hypot(row, column) - 40
    for width, changed in ((1.0, False), (30.0, True)):
        cover = np.clip(0.5 - away / width, 0, 1)
        mixed = cover[..., None] * np.array([150.0, 150, 150]) + (1 - cover[..., None]) * [
            0,
            0,
            200,
        ]
        photo = saved(tmp_path / "a.png", _image(np.rint(mixed).astype(np.uint8)))
        mask = saved(tmp_path / "m.png", _image(np.rint(255 * cover).astype(np.uint8)))
        (saw, plain) = (read_photo(photo, m).image for m in (mask, saved_hard(tmp_path, cover)))
        assert (saw != plain).any() == changed


def saved_hard(folder: Path, cover: np.ndarray) -> Path:
    return saved(folder / "h.png", _image(np.where(cover >= 0.5, 255, 0).astype(np.uint8)))


def _image(values: np.ndarray) -> Image.Image:
    return Image.fromarray(values)


@pytest.mark.parametrize("alpha", [255, 254, "a stray row"])
def test_an_alpha_channel_that_leaves_nothing_out_is_no_mask(
    tmp_path: Path, alpha: int | str
) -> None:
    codes = np.where(object_mask(), 255, 0).astype(np.uint8)
    opaque = np.full((H, W), 255 if isinstance(alpha, str) else alpha, np.uint8)
    if isinstance(alpha, str):
        opaque[0] = 128
    mask = tmp_path / "mask.png"
    Image.fromarray(np.dstack([codes, codes, codes, opaque]), "RGBA").save(mask)
    photo = tmp_path / "photo.png"
    shade = np.linspace(60, 200, W, dtype=np.uint8)
    Image.fromarray(np.broadcast_to(shade[:, None], (H, W, 3)).copy()).save(photo)
    assert np.array_equal(read_photo(photo, mask).mask, object_mask())


def test_alpha_comes_before_the_black_border(tmp_path: Path) -> None:
    alpha = np.zeros((H, W), np.uint8)
    alpha[8:30, 10:40] = 127
    alpha[10:28, 12:38] = 128
    photo = read_photo(saved(tmp_path / "a.png", Image.fromarray(np.dstack([codes(), alpha]))))
    assert photo.box == (12, 10, 26, 18) and photo.original.mask_from == "alpha"


def test_an_alpha_channel_with_stray_pixels_is_no_mask(tmp_path: Path) -> None:
    alpha = np.full((H, W), 255, np.uint8)
    alpha[3, 4], alpha[:, 0] = 0, 250
    path = saved(tmp_path / "a.png", Image.fromarray(np.dstack([codes() // 2 + 50, alpha])))
    assert read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK).original.mask_from == "whole frame"
    with pytest.raises(InputError, match="there is no mask"):
        read_photo(path)


def test_black_border_fills_holes_and_drops_specks(tmp_path: Path) -> None:
    stored = np.zeros((200, 200, 3), np.uint8)
    stored[20:120, 20:120] = np.random.default_rng(0).integers(50, 90, (100, 100, 3))
    stored[60:70, 60:70] = 0
    stored[80, 80] = (90, 0, 0)
    stored[150:170, 20:40] = 60
    stored[150:155, 150:155] = 60
    stored[::7, 199] = 2
    photo = read_photo(write(tmp_path / "a.png", png(stored, 8, 2)))
    expected = np.zeros((200, 200), bool)
    expected[20:120, 20:120] = expected[150:170, 20:40] = True
    assert (photo.mask == expected).all()
    assert photo.image[80, 80, 1] == 0 and photo.mask[80, 80]
    stored[3, 0] = 3
    refused(write(tmp_path / "b.png", png(stored, 8, 2)), "isc mask PHOTO --box x,y,w,h -o MASK")


@pytest.mark.parametrize("highlight", [1.0, 1e3, 6e4])
def test_bright_highlights_of_a_float_photo_leave_the_mask_as_it_is(
    tmp_path: Path, highlight: float
) -> None:
    light = np.zeros((80, 80, 3), np.float32)
    light[10:70, 10:70] = np.random.default_rng(0).uniform(0.1, 0.4, (60, 60, 3))
    expected = light.any(axis=2)
    light[30:38, 30:38] = highlight  # 2 % of the object
    np.save(tmp_path / "a.npy", light)
    photo = read_photo(tmp_path / "a.npy")
    assert photo.original.mask_from == "black border" and (photo.mask == expected).all()


def test_tidy_mask_treats_diagonals_as_joined() -> None:
    mask = np.zeros((60, 60), bool)
    mask[5:30, 5:30] = mask[30:33, 30:33] = True
    mask[50:52, 50:52] = True
    tidy = tidy_mask(mask)
    assert tidy[31, 31] and not tidy[50, 50] and (tidy_mask(tidy) == tidy).all()


def test_bad_masks(tmp_path: Path) -> None:
    photo = write(tmp_path / "a.png", png(codes() + 7, 8, 2))

    def mask(name: str, shape: tuple[int, int], *boxes: tuple[slice, slice]) -> Path:
        values = np.zeros(shape, np.uint8)
        for box in boxes:
            values[box] = 255
        return saved(tmp_path / f"{name}.png", Image.fromarray(values))

    everywhere = (slice(None), slice(None))
    refused(photo, "30 x 20", f"{W} x {H}", mask=mask("size", (20, 30), everywhere))
    refused(photo, "mask is empty", mask=mask("empty", (H, W)))
    refused(photo, "only 3 pixels", mask=mask("three", (H, W), (slice(4, 5), slice(4, 7))))
    refused(photo, "only 40 x 7 pixels", mask=mask("thin", (H, W), (slice(4, 11), slice(4, 44))))
    refused(photo, "no such file", mask=tmp_path / "none.png")
    refused(photo, "known format", mask=write(tmp_path / "t.png", b"words"))
    assert read_photo(photo, mask("all", (H, W), everywhere)).mask.all()
    clear = Image.fromarray(np.dstack([codes(), np.zeros((H, W), np.uint8)]))
    refused(saved(tmp_path / "clear.png", clear), "mask is empty")


# --- resizing -------------------------------------------------------------------------------------


def photo_of(image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None) -> Photo:
    source = PhotoSource("", (mask.shape[1], mask.shape[0]), 8, "srgb", "file")
    return Photo(
        image.astype(np.float32),
        mask,
        3e-4,
        np.zeros_like(mask) if clipped is None else clipped,
        source,
    )


def test_nothing_is_enlarged() -> None:
    photo = photo_of(np.ones((H, W, 3)), object_mask())
    assert photo.resized_to_object() is photo and photo.resized_to_object(0) is photo
    with pytest.raises(InputError, match="--max-size -1"):
        photo.resized_to_object(-1)


@pytest.mark.slow
@pytest.mark.parametrize("max_size", [512, 300, 199, 77, 33])
def test_the_box_obeys_max_size_at_one_scale(max_size: int) -> None:
    mask = object_mask(401, 733)
    ramp = np.dstack([np.mgrid[:401, :733][1]] * 3) + 0.5
    small = photo_of(ramp, mask).resized_to_object(max_size)
    assert max_size - 2 <= max(small.box[2:]) <= max_size
    assert small.image.shape[:2] == (
        int(np.ceil(401 * small.scale - 1e-6)),
        int(np.ceil(733 * small.scale - 1e-6)),
    )
    # A pixel wholly inside shows the ramp's value at its own centre: no shift, one scale on both
    # axes.
    core = cv2.erode(small.mask.astype(np.uint8), np.ones((3, 3))) > 0
    centres = (np.mgrid[: core.shape[0], : core.shape[1]][1] + 0.5) / small.scale
    assert small.image[core, 0] == pytest.approx(centres[core], abs=0.26)
    assert small.original.size == (733, 401)


@pytest.mark.parametrize("factor", [2, 3, 4])
def test_whole_factors_average_blocks_of_linear_light(factor: int) -> None:
    rng = np.random.default_rng(factor)
    image = rng.uniform(0, 1, (96, 120, 3))
    small = photo_of(image, np.ones((96, 120), bool)).resized_to_object(120 // factor)
    blocks = image.reshape(96 // factor, factor, 120 // factor, factor, 3).mean(axis=(1, 3))
    assert small.image == pytest.approx(blocks, abs=1e-6) and small.mask.all()


def test_background_and_object_do_not_mix() -> None:
    mask = object_mask(301, 417)
    image = np.where(mask[..., None], [0.2, 0.3, 0.4], [50.0, 0.0, 9.0])
    small = photo_of(image, mask).resized_to_object(61)
    assert small.image[small.mask] == pytest.approx(
        np.broadcast_to([0.2, 0.3, 0.4], (small.mask.sum(), 3)), rel=1e-5
    )
    assert small.image[~small.mask] == pytest.approx(
        np.broadcast_to([50.0, 0.0, 9.0], ((~small.mask).sum(), 3)), rel=1e-5
    )
    assert small.mask.sum() == pytest.approx(mask.sum() * small.scale**2, rel=0.01)


def test_clipping_survives_resizing() -> None:
    clipped = np.zeros((200, 240), bool)
    clipped[101, 121] = clipped[2, 2] = True
    small = photo_of(np.ones((200, 240, 3)), object_mask(200, 240), clipped).resized_to_object(24)
    assert (
        small.clipped.sum() == 1
        and small.clipped[int(101.5 * small.scale), int(121.5 * small.scale)]
    )


def test_a_long_object_names_the_size_that_it_needs() -> None:
    mask = np.zeros((60, 2000), bool)
    mask[20:40, 10:1990] = True
    photo = photo_of(np.random.default_rng(0).uniform(0, 1, (60, 2000, 3)), mask)
    with pytest.raises(InputError, match="only 5 pixels thin: use 891 or more"):
        photo.resized_to_object(512)
    assert min(photo.resized_to_object(891).box[2:]) >= 8


# --- bad files ------------------------------------------------------------------------------------


def every_kind(folder: Path) -> list[Path]:
    """One good file of each kind and way of reading."""
    stored = np.where(object_mask()[..., None], cv2.GaussianBlur(codes(), (0, 0), 2), 0)
    light = (stored / 255).astype(np.float32)
    image = Image.fromarray(stored)
    return [
        write(folder / "8.png", png(stored, 8, 2)),
        write(folder / "16.png", png(stored.astype(np.uint16) * 257, 16, 2)),
        saved(folder / "a.jpg", image),
        saved(folder / "p.jpg", image, progressive=True),
        saved(folder / "a.bmp", image),
        saved(folder / "a.ppm", image),
        saved(folder / "a.tif", image),
        saved(folder / "lzw.tif", image, compression="tiff_lzw"),
        opencv(folder / "16.tif", stored.astype(np.uint16) * 257),
        write(folder / "strip16.tif", tiff_16(stored.astype(np.uint16) * 257, 1)),
        opencv(folder / "f.tif", light, cv2.IMWRITE_TIFF_COMPRESSION, 1),
        write_exr(folder / "a.exr", {c: light[..., i] for i, c in enumerate("RGB")}),
        write_exr(
            folder / "raw.exr",
            {c: light[..., i] for i, c in enumerate("RGB")},
            compression=OpenEXR.NO_COMPRESSION,
        ),
        opencv(folder / "a.hdr", light),
        arrayed(folder / "a.npy", light),
    ]


def test_truncated_files_of_every_kind_are_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for file in every_kind(tmp_path):
        data = file.read_bytes()
        assert read_raster(file).values.shape == (H, W, 3)
        for part in (0.02, 0.1, 0.35, 0.6, 0.9, 0.99):
            short = write(tmp_path / f"short{file.suffix}", data[: int(len(data) * part)])
            with pytest.raises(InputError, match="damaged|known format") as caught:
                read_raster(short)
            assert "\n" not in str(caught.value) and str(short) in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_damaged_pixels_of_a_png_are_found(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for bits in (8, 16):
        flipped = bytearray(png(codes(255 if bits == 8 else 65535), bits, 2))
        flipped[len(flipped) // 2] ^= 0x10
        refused(write(tmp_path / "a.png", bytes(flipped)), "PNG file is damaged")
    half = codes(65535)
    data = png(half, 16, 2).replace(struct.pack(">II", W, H), struct.pack(">II", W, 2 * H))
    header = data[12:29]
    data = data[:29] + struct.pack(">I", zlib.crc32(header)) + data[33:]
    refused(write(tmp_path / "b.png", data), "PNG file is damaged")
    assert capfd.readouterr() == ("", "")


def test_files_that_are_no_images(tmp_path: Path) -> None:
    refused(tmp_path / "none.png", "no such file")
    refused(tmp_path, "is a folder")
    refused(write(tmp_path / "empty.png", b""), "the file is empty")
    refused(write(tmp_path / "text.png", b"These are words.\n" * 9), "known format")
    refused(write(tmp_path / "head.png", b"\x89PNG\r\n\x1a\n"), "damaged")
    assert read_raster(
        saved(tmp_path / "is_a_jpeg.png", Image.fromarray(codes()), format="JPEG")
    ).values.shape == (H, W, 3)


def test_cmyk_is_refused_with_the_remedy(tmp_path: Path) -> None:
    image = Image.fromarray(codes()).convert("CMYK")
    refused(saved(tmp_path / "a.jpg", image), "CMYK", "convert it to RGB")
    refused(saved(tmp_path / "a.tif", image), "CMYK", "convert it to RGB")


def test_sizes_are_refused_from_the_header(tmp_path: Path) -> None:
    def header_only(w: int, h: int) -> Path:
        ihdr = chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, 8, 2, 0, 0, 0))
        return write(
            tmp_path / "a.png",
            b"\x89PNG\r\n\x1a\n" + ihdr + chunk(b"IDAT", zlib.compress(b"0")) + chunk(b"IEND", b""),
        )

    refused(header_only(20_000, 20_000), "20000 x 20000", "100 megapixels")
    refused(header_only(9_000, 9_000), "damaged")  # 81 megapixels pass the limit
    refused(header_only(1, 500), "1 x 500", "at least 8")
    refused(header_only(60_000, 10), "60000 x 10", "crop")
    refused(write(tmp_path / "a.ppm", b"P6 30000 30000 255\n"), "100 megapixels")
    refused(write(tmp_path / "b.ppm", b"P6 30000 30000 65535\n"), "100 megapixels")
    refused(
        write(tmp_path / "a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 30000 +X 30000\n"),
        "100 megapixels",
    )
    buffer = io.BytesIO()
    Image.fromarray(codes()).save(buffer, "bmp")
    data = bytearray(buffer.getvalue())
    data[18:26] = struct.pack("<ii", 30_000, 30_000)
    refused(write(tmp_path / "a.bmp", bytes(data)), "100 megapixels")
    window = (np.array([0, 0], np.int32), np.array([3, 99], np.int32))
    refused(
        write_exr(tmp_path / "a.exr", {"Y": np.ones((100, 4), np.float32)}, dataWindow=window),
        "4 x 100",
    )
    assert Limits().max_pixels == 100_000_000


@pytest.mark.parametrize(
    ("bad", "word"),
    [(np.nan, "NaN"), (np.inf, "infinite"), (-np.inf, "infinite"), (-0.5, "negative")],
)
def test_unusable_values_of_an_exr(tmp_path: Path, bad: float, word: str) -> None:
    light = (codes(65535) / 65535).astype(np.float32)
    light[2, 3, 1] = bad
    mask = saved(tmp_path / "m.png", Image.fromarray(object_mask()))
    photo = read_photo(
        write_exr(tmp_path / "a.exr", {c: light[..., i] for i, c in enumerate("RGB")}), mask
    )
    assert np.isfinite(photo.image).all() and photo.image.min() == 0
    assert np.isfinite(read_linear(tmp_path / "a.exr")).all()
    light[20, 20:23, 1] = bad
    path = write_exr(tmp_path / "b.exr", {c: light[..., i] for i, c in enumerate("RGB")})
    refused(path, "3 pixels inside the mask are", word, mask=mask)
    refused(path, "3 pixels inside the mask are", word)


def test_a_broken_pixel_of_an_exr_is_refused_and_a_lamp_is_not(tmp_path: Path) -> None:
    light = (codes(65535) / 65535).astype(np.float32)
    mask = saved(tmp_path / "m.png", Image.fromarray(object_mask()))
    light[20, 20] = 1e5
    photo = read_photo(
        write_exr(tmp_path / "a.exr", {c: light[..., i] for i, c in enumerate("RGB")}), mask
    )
    assert np.argwhere(photo.clipped).tolist() == [[20, 20]]
    assert photo.image[20, 20].min() == photo.image.max() > 40
    light[20, 20] = 1e30
    refused(
        write_exr(tmp_path / "b.exr", {c: light[..., i] for i, c in enumerate("RGB")}),
        "1 pixels inside the mask are brighter",
        mask=mask,
    )


def test_constant_and_black_images(tmp_path: Path) -> None:
    flat = np.full((H, W, 3), (200, 10, 10), np.uint8)
    refused(write(tmp_path / "a.png", png(flat, 8, 2)), "every pixel is the same")
    refused(write(tmp_path / "b.png", png(0 * flat, 8, 2)), "every pixel is black")
    refused(
        write(tmp_path / "c.png", png(flat * object_mask()[..., None], 8, 2)),
        "every pixel inside the mask is the same",
    )
    dark = np.where(object_mask()[..., None], 2, 0) * np.ones((1, 1, 3), int)
    refused(write(tmp_path / "d.png", png(dark, 8, 2)), "almost black")
    mask = saved(tmp_path / "m.png", Image.fromarray(~object_mask()))
    refused(
        write(tmp_path / "e.png", png(codes(), 8, 2)),
        "every pixel inside the mask is black",
        mask=mask,
    )
    nothing = np.full((H, W), np.nan, np.float32)
    refused(write_exr(tmp_path / "f.exr", {"Y": nothing}), "image is black")


def test_the_terminal_stays_clean_for_odd_but_good_files(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bad_profile = chunk(b"iCCP", b"x\0\0" + zlib.compress(b"no profile"))
    for bits in (8, 16):
        stored = codes(255 if bits == 8 else 65535)
        assert read_photo(write(tmp_path / "a.png", png(stored, bits, 2, bad_profile))).mask.any()
    assert capfd.readouterr() == ("", "")


def test_standard_error_works_after_reading(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    read_raster(write(tmp_path / "a.png", png(codes(), 8, 2)))
    refused(write(tmp_path / "b.png", b"\x89PNG\r\n\x1a\n"), "damaged")
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"


# --- real photos ----------------------------------------------------------------------------------


def test_the_masked_photos(shared: Path) -> None:
    files = sorted((shared / "data" / "photos").glob("*.png"))
    assert len(files) == 14
    for file in files:
        photo = read_photo(file)
        assert photo.original.mask_from == "black border" and photo.mask.mean() > 0.2, file.name
        assert np.isfinite(photo.image).all() and photo.image.min() >= 0
        _, parts = cv2.connectedComponents(photo.mask.astype(np.uint8), connectivity=8)
        assert parts.max() == 1, file.name
        small = photo.resized_to_object(100)
        assert max(small.box[2:]) <= 100
        assert small.image[small.mask].mean() == pytest.approx(
            photo.image[photo.mask].mean(), rel=0.03
        )


@pytest.mark.slow
def test_linear_16_bit_photos_of_mit_berkeley(shared: Path) -> None:
    for name in ("apple", "cup1"):
        folder = shared / "data" / "mit_berkeley_train" / "laboratory" / name
        photo = read_photo(folder / "original.png", folder / "mask.png", transfer="linear")
        stored = cv2.imread(str(folder / "original.png"), cv2.IMREAD_UNCHANGED)[..., ::-1]
        truth = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_UNCHANGED) > 0
        assert (
            photo.image == pytest.approx(stored / 65535, abs=1e-7) and (photo.mask == truth).all()
        )
        found = read_photo(folder / "original.png", transfer="linear").mask
        assert (found & truth).sum() / (found | truth).sum() > 0.97
        assert mask_box(found) == pytest.approx(mask_box(truth), abs=3)


def test_a_photo_without_black_border_names_the_remedy(shared: Path) -> None:
    refused(shared / "data" / "highlight" / "animals.bmp", "isc mask PHOTO --box")
