"""Images leave Blender with the light they hold: whatever made them, the worker's reader gives the
values that Blender shows.
"""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.datablocks.staging import run_to_end  # noqa: E402 (after the skip)
from blender_addon.files.image_export import (  # noqa: E402
    export_image,
    export_mask,
    resize_mask,
    to_codes,
    to_linear,
    to_mask,
)
from blender_addon.files.image_source import (  # noqa: E402
    ImageSource,
    exif_orientation,
    inspect_image,
)
from isc_core.errors import InputError  # noqa: E402
from isc_core.imaging.srgb import srgb_to_linear  # noqa: E402
from isc_core.photo import read_photo, read_raster  # noqa: E402

WIDTH, HEIGHT = 14, 10


@pytest.fixture(autouse=True)
def fresh() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def generated(
    name: str = "photo",
    *,
    floats: bool = False,
    alpha: bool = True,
    width: int = WIDTH,
    height: int = HEIGHT,
) -> Any:
    """An image of Blender's own, with another value in every pixel."""
    image = bpy.data.images.new(name, width, height, float_buffer=floats, alpha=alpha)
    values = np.random.default_rng(1).uniform(0.1, 0.9, (height, width, 4)).astype(np.float32)
    values[..., 3] = 1
    image.pixels.foreach_set(values[::-1].ravel())
    return image


def pixels_of(image: Any) -> np.ndarray:
    """(H, W, 4), row 0 at the top."""
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], -1)[::-1]


def given(image: Any, folder: Path) -> tuple[Path, str]:
    picture = inspect_image(image)
    return run_to_end(export_image(picture, folder / "photo")), picture.transfer


def known_file(path: Path, kind: type, channels: int = 3) -> np.ndarray:
    """A picture file (H, W, channels) of codes, written; BGR(A) as OpenCV has them."""
    values: np.ndarray = (
        np.random.default_rng(2)
        .integers(0, np.iinfo(kind).max, (HEIGHT, WIDTH, channels), endpoint=True)
        .astype(kind)
    )
    assert cv2.imwrite(str(path), values)
    return values


def test_an_unchanged_file_is_used_directly(tmp_path: Path) -> None:
    codes16 = known_file(tmp_path / "deep.png", np.uint16)
    path, transfer = given(bpy.data.images.load(str(tmp_path / "deep.png")), tmp_path)
    assert path == tmp_path / "deep.png" and transfer == "auto"
    np.testing.assert_array_equal(read_raster(path).values, codes16[..., ::-1])


@pytest.mark.parametrize(
    ("space", "transfer"), [("sRGB", "auto"), ("Non-Color", "linear"), ("Linear Rec.709", "linear")]
)
def test_the_colour_space_determines_the_transfer(
    tmp_path: Path, space: str, transfer: str
) -> None:
    known_file(tmp_path / "a.png", np.uint8)
    image = bpy.data.images.load(str(tmp_path / "a.png"))
    image.colorspace_settings.name = space
    assert given(image, tmp_path) == (tmp_path / "a.png", transfer)


def test_a_packed_file_keeps_its_bits_without_the_file(tmp_path: Path) -> None:
    codes16 = known_file(tmp_path / "deep.png", np.uint16)
    image = bpy.data.images.load(str(tmp_path / "deep.png"))
    image.pack()
    (tmp_path / "deep.png").unlink()
    path, _ = given(image, tmp_path)
    assert path == tmp_path / "photo.png"
    np.testing.assert_array_equal(read_raster(path).values, codes16[..., ::-1])


def test_edits_of_a_saved_photo_are_exported(tmp_path: Path) -> None:
    stored = known_file(tmp_path / "a.png", np.uint8)
    image = bpy.data.images.load(str(tmp_path / "a.png"))
    values = pixels_of(image).copy()
    values[0, 0, :3] = 1
    image.pixels.foreach_set(values[::-1].ravel())
    path, transfer = given(image, tmp_path)
    wanted = stored[..., ::-1].copy()
    wanted[0, 0] = 255
    got = read_raster(path)
    assert transfer == "srgb" and got.peak == 255  # so that clipped pixels stay known as clipped
    np.testing.assert_array_equal(got.values, wanted)


def test_a_generated_byte_image_is_srgb(tmp_path: Path) -> None:
    image = generated()
    path, transfer = given(image, tmp_path)
    np.testing.assert_allclose(
        srgb_to_linear(read_raster(path).values / 255),
        srgb_to_linear(pixels_of(image)[..., :3]),
        atol=1e-6,
    )
    assert transfer == "srgb"


def test_a_generated_float_image_keeps_values_above_one(tmp_path: Path) -> None:
    image = generated(floats=True)
    values = pixels_of(image).copy()
    values[2, 3, :3] = 7.5
    image.pixels.foreach_set(values[::-1].ravel())
    path, transfer = given(image, tmp_path)
    assert transfer == "linear"
    np.testing.assert_allclose(read_raster(path).values, values[..., :3], rtol=1e-6)


def test_an_edited_16_bit_file_stays_linear(tmp_path: Path) -> None:
    """Blender holds a 16-bit sRGB file as linear floats: they must not be decoded once more."""
    stored = known_file(tmp_path / "deep.png", np.uint16)
    image = bpy.data.images.load(str(tmp_path / "deep.png"))
    values = pixels_of(image).copy()
    values[0, 0, :3] = 0.25
    image.pixels.foreach_set(values[::-1].ravel())
    path, transfer = given(image, tmp_path)
    wanted = srgb_to_linear(stored[..., ::-1] / 65535)
    wanted[0, 0] = 0.25
    assert transfer == "linear"
    np.testing.assert_allclose(read_raster(path).values, wanted, atol=2e-5)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_alpha_is_exported_straight(tmp_path: Path, kind: type) -> None:
    """Float images hold colours multiplied by alpha, byte images do not: the worker wants neither
    multiplied.
    """
    stored = known_file(tmp_path / "a.png", kind, 4)
    stored[..., 3] = np.where(
        np.indices((HEIGHT, WIDTH))[1] < 7, np.iinfo(kind).max // 2, np.iinfo(kind).max
    )
    cv2.imwrite(str(tmp_path / "a.png"), stored)
    image = bpy.data.images.load(str(tmp_path / "a.png"))
    path = run_to_end(export_image(inspect_image(image, as_pixels=True), tmp_path / "photo"))
    got = read_raster(path)
    peak = float(np.iinfo(kind).max)
    light_of = got.values if kind == np.uint16 else srgb_to_linear(got.values / 255)
    np.testing.assert_allclose(light_of, srgb_to_linear(stored[..., 2::-1] / peak), atol=1e-4)
    np.testing.assert_allclose(got.alpha, stored[..., 3] / peak, atol=1e-4)


def test_ignored_transparency_is_no_mask(tmp_path: Path) -> None:
    known_file(tmp_path / "a.png", np.uint8, 4)
    image = bpy.data.images.load(str(tmp_path / "a.png"))
    image.alpha_mode = "NONE"
    path, _ = given(image, tmp_path)
    assert path.suffix == ".npy" and read_raster(path).alpha is None


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_a_photo_with_a_rotation_flag_stays_as_blender_shows_it(
    tmp_path: Path, suffix: str
) -> None:
    from PIL import Image

    flag = Image.Exif()
    flag[0x0112] = 6
    smooth = np.linspace(30, 220, HEIGHT * WIDTH * 3).reshape(HEIGHT, WIDTH, 3).astype(np.uint8)
    Image.fromarray(smooth).save(tmp_path / f"a{suffix}", exif=flag)
    assert exif_orientation((tmp_path / f"a{suffix}").read_bytes()) == 6
    image = bpy.data.images.load(str(tmp_path / f"a{suffix}"))
    path, _ = given(image, tmp_path)
    assert read_raster(tmp_path / f"a{suffix}").values.shape[:2] == (WIDTH, HEIGHT), (
        "the worker's reader turns it"
    )
    np.testing.assert_array_equal(
        read_raster(path).values, np.rint(255 * pixels_of(image)[..., :3]).astype(np.uint8)
    )


def test_upright_files_are_upright(tmp_path: Path) -> None:
    known_file(tmp_path / "a.png", np.uint8)
    known_file(tmp_path / "a.tif", np.uint8)
    assert [exif_orientation((tmp_path / name).read_bytes()) for name in ("a.png", "a.tif")] == [
        1,
        1,
    ]
    assert (
        exif_orientation(b"\xff\xd8\xff\xe1\0\0Exif\0\0II*\0\xff\xff\0\0") == 0
    )  # the table lies beyond the bytes: unknown


def test_a_wider_working_space_is_converted_to_rec709() -> None:
    to_rec709 = np.array([[1.6, -0.5, -0.1], [-0.1, 1.1, 0], [0, -0.1, 1.1]], np.float32)
    picture = ImageSource(
        "a", size=(1, 1), channels=4, is_float=True, associated=True, to_rec709=to_rec709
    )
    pixels = np.array([[[0.2, 0.3, 0.1, 0.5]]], np.float32)
    got = to_linear(picture, pixels)
    np.testing.assert_allclose(got[0, 0, :3], to_rec709 @ [0.4, 0.6, 0.2], rtol=1e-6)
    assert got[0, 0, 3] == 0.5


def test_a_grey_float_image_has_three_channels() -> None:
    picture = ImageSource("a", size=(2, 1), channels=1, is_float=True)
    np.testing.assert_array_equal(
        to_linear(picture, np.array([[[0.25], [4.0]]], np.float32))[0], [[0.25] * 3, [4.0] * 3]
    )


def test_codes_survive_conversion_to_float() -> None:
    every = np.arange(256, dtype=np.float32).reshape(16, 16, 1) / 255
    opaque = np.concatenate([every, every, every, np.ones_like(every)], axis=2)
    np.testing.assert_array_equal(
        to_codes(ImageSource("a"), opaque)[..., 0].ravel(), np.arange(256)
    )


# --- masks ----------------------------------------------------------------------------------------


def test_a_painted_mask_fits_the_photo(tmp_path: Path) -> None:
    image = generated("mask")
    white = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    white[..., 3] = 1
    white[2:5, 3:9] = 1
    image.pixels.foreach_set(white[::-1].ravel())
    path = run_to_end(export_mask(inspect_image(image, as_pixels=True), tmp_path / "mask"))
    np.testing.assert_array_equal(np.load(path), white[..., 0] > 0)


def test_a_mask_may_be_alpha() -> None:
    pixels = np.ones((2, 2, 4), np.float32)
    pixels[0, 0] = 0
    np.testing.assert_array_equal(to_mask(ImageSource("m"), pixels), [[False, True], [True, True]])


def test_a_mask_is_above_half_of_its_brightest_value() -> None:
    pixels = np.array([[[0, 0, 0, 1], [0.1, 0, 0, 1], [0.3, 0.3, 0.3, 1]]], np.float32)
    np.testing.assert_array_equal(to_mask(ImageSource("m"), pixels), [[False, False, True]])


def test_an_empty_mask_is_refused() -> None:
    pixels = np.zeros((3, 3, 4), np.float32)
    pixels[..., 3] = 1
    with pytest.raises(InputError, match="mask m is empty: paint"):
        to_mask(ImageSource("m"), pixels)


def test_a_mask_is_scaled_by_pixel_centres() -> None:
    mask = np.zeros((4, 6), bool)
    mask[1:3, 2:5] = True
    np.testing.assert_array_equal(resize_mask(mask, (12, 8)), mask.repeat(2, 0).repeat(2, 1))
    np.testing.assert_array_equal(resize_mask(resize_mask(mask, (18, 12)), (6, 4)), mask)


def test_a_mask_of_another_size_is_scaled_on_demand(tmp_path: Path) -> None:
    photo, mask = generated(), generated("mask", width=9, height=20)
    path = run_to_end(
        export_mask(inspect_image(mask, as_pixels=True), tmp_path / "mask", tuple(photo.size))
    )
    assert np.load(path).shape == (HEIGHT, WIDTH)


# --- invalid images ------------------------------------------------------------------------------


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    image = generated()
    image.source = "FILE"
    image.filepath = str(tmp_path / "nowhere.png")
    image.reload()
    with pytest.raises(InputError, match=r"photo has no data: its file .*nowhere.png is missing"):
        inspect_image(image)


def test_a_file_that_blender_cannot_show_names_the_remedy(tmp_path: Path) -> None:
    (tmp_path / "phone.heic").write_bytes(b"\0\0\0\x18ftypheic" + bytes(100))
    image = generated()
    image.source = "FILE"
    image.filepath = str(tmp_path / "phone.heic")
    image.reload()
    with pytest.raises(InputError, match="is a HEIC file, which Blender cannot show: save it"):
        inspect_image(image)


def test_a_single_pixel_is_refused() -> None:
    with pytest.raises(InputError, match="is 1 x 1 pixels: choose a larger one"):
        inspect_image(generated(width=1, height=1))


@pytest.mark.parametrize(
    ("source", "word"), [("MOVIE", "movie"), ("SEQUENCE", "sequence"), ("TILED", "tiles")]
)
def test_movies_sequences_and_tiles_are_refused(source: str, word: str) -> None:
    image = generated()
    image.source = source
    with pytest.raises(InputError, match=word):
        inspect_image(image)


def test_a_byte_image_in_an_unknown_space_is_refused() -> None:
    image = generated()
    image.colorspace_settings.name = "ACEScg"
    with pytest.raises(InputError, match="color space ACEScg: choose sRGB"):
        inspect_image(image)


def test_an_image_removed_in_the_meantime_is_reported(tmp_path: Path) -> None:
    image = generated()
    steps = export_image(inspect_image(image), tmp_path / "photo")
    bpy.data.images.remove(image)
    with pytest.raises(InputError, match="was removed or resized in the meantime"):
        run_to_end(steps)


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        InputError,
        match=r"cannot write .* \(No such file or directory\): choose another cache folder",
    ):
        run_to_end(export_image(inspect_image(generated()), tmp_path / "nowhere" / "photo"))


def test_names_of_any_letters_reach_the_worker(tmp_path: Path) -> None:
    path, _ = given(generated("a/b: Tässchen 杯子"), tmp_path)
    assert path == tmp_path / "photo.npy"


def test_the_worker_reads_image_and_mask(tmp_path: Path) -> None:
    """The worker's reader accepts the exported files."""
    image, mask = generated(width=40, height=30), generated("mask", width=40, height=30)
    shape = np.zeros((30, 40, 4), np.float32)
    shape[..., 3] = 1
    shape[5:25, 8:30] = 1
    mask.pixels.foreach_set(shape[::-1].ravel())
    photo_path, transfer = given(image, tmp_path)
    mask_path = run_to_end(export_mask(inspect_image(mask), tmp_path / "mask"))
    photo = read_photo(photo_path, mask_path, transfer)
    np.testing.assert_array_equal(photo.mask, shape[..., 0] > 0)
    np.testing.assert_allclose(photo.image, srgb_to_linear(pixels_of(image)[..., :3]), atol=1e-6)
