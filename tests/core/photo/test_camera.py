"""The camera of a photo: from real files with EXIF, through orientation and resizing."""

import io
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image, TiffImagePlugin
from PIL.TiffImagePlugin import IFDRational

from isc_core.io.decoders.exif import with_focal_length
from isc_core.io.decoders.raster import Raster, raster_of_codes
from isc_core.io.focal_length import pixels_of_35mm
from isc_core.photo import Photo, WholeFrame, read_photo
from isc_core.photo.camera import Camera

H, W = 48, 64
IN_35MM, LENGTH, PIXEL_X, PIXEL_Y = 0xA405, 0x920A, 0xA002, 0xA003
PLANE_X, PLANE_UNIT, ORIENTATION = 0xA20E, 0xA210, 0x0112
DIAGONAL = math.hypot(36, 24)


def codes(kind: type = np.uint8, peak: int = 255) -> np.ndarray:
    """A bright ellipse on black."""
    row, column = np.indices((H, W))
    inside = ((row - 23) / 18) ** 2 + ((column - 30) / 24) ** 2 < 1
    values = np.random.default_rng(0).integers(peak // 4, peak, (H, W, 3))
    return np.where(inside[..., None], values, 0).astype(kind)


def exif(tags: dict[int, Any], orientation: int = 1) -> Image.Exif:
    """EXIF with tags of the photo."""
    data = Image.Exif()
    data[ORIENTATION] = orientation
    data.get_ifd(0x8769).update(tags)
    return data


def jpeg(folder: Path, tags: dict[int, Any], orientation: int = 1) -> Photo:
    """A JPEG with these tags, read."""
    path = folder / "photo.jpg"
    Image.fromarray(codes()).save(path, quality=95, exif=exif(tags, orientation))
    return read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK)


def png_of_16_bits(path: Path, data: Image.Exif) -> None:
    """Pillow writes no 16-bit RGB: a PNG of OpenCV with the eXIf chunk of one of Pillow's."""
    stream = io.BytesIO()
    Image.fromarray(codes()).save(stream, "png", exif=data)
    plain = stream.getvalue()
    at = plain.index(b"eXIf") - 4
    chunk = plain[at : at + 12 + int.from_bytes(plain[at : at + 4], "big")]
    deep = cv2.imencode(".png", codes(np.uint16, 65535))[1].tobytes()
    path.write_bytes(deep[:33] + chunk + deep[33:])


def test_the_35mm_equivalent_refers_to_the_diagonal(tmp_path: Path) -> None:
    photo = jpeg(tmp_path, {IN_35MM: 26, PIXEL_X: W, PIXEL_Y: H})
    assert photo.camera == Camera(26 / DIAGONAL * math.hypot(W, H), (W / 2, H / 2))
    assert pixels_of_35mm(DIAGONAL, (W, H)) == math.hypot(W, H)
    assert not photo.original.cropped


@pytest.mark.parametrize("kind", ["jpg", "tif", "png", "deep.png"])
def test_the_focal_length_is_read_from_every_format_with_exif(tmp_path: Path, kind: str) -> None:
    path, data = tmp_path / f"photo.{kind}", exif({IN_35MM: 40})
    if kind == "deep.png":
        png_of_16_bits(path, data)
    elif kind == "tif":  # Pillow drops the tags of an Exif object
        tags = TiffImagePlugin.ImageFileDirectory_v2()
        tags[0x8769] = {IN_35MM: 40}
        Image.fromarray(codes()).save(path, tiffinfo=tags)
    else:
        Image.fromarray(codes()).save(path, exif=data)
    camera = read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK).camera
    assert camera is not None
    assert camera.focal_length == pytest.approx(pixels_of_35mm(40, (W, H)))


def test_blocks_of_exif_are_read_as_well() -> None:
    raster = raster_of_codes(codes(), 255)
    for data in (exif({IN_35MM: 40}), exif({IN_35MM: 40}).tobytes()):
        found = with_focal_length(raster, data).focal_length
        assert found is not None
        assert found.pixels == pytest.approx(pixels_of_35mm(40, (W, H)))


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_it_follows_the_upright_photo(tmp_path: Path, orientation: int) -> None:
    photo = jpeg(tmp_path, {IN_35MM: 26, PIXEL_X: W, PIXEL_Y: H}, orientation)
    height, width = photo.mask.shape
    assert (width, height) == ((H, W) if orientation > 4 else (W, H))
    assert photo.camera == Camera.of_frame(pixels_of_35mm(26, (W, H)), (width, height))


@pytest.mark.parametrize(("unit", "density"), [(2, 2540), (3, 1000), (4, 100), (None, 2540)])
def test_a_sensors_resolution_serves_where_there_is_no_equivalent(
    tmp_path: Path, unit: int | None, density: int
) -> None:
    tags: dict[int, Any] = {LENGTH: IFDRational(6, 10), PLANE_X: IFDRational(density, 1)}
    tags |= {} if unit is None else {PLANE_UNIT: unit}
    photo = jpeg(tmp_path, tags)
    assert photo.camera is not None
    assert photo.camera.focal_length == pytest.approx(0.6 * 100)
    resized = jpeg(tmp_path, tags | {PIXEL_X: 2 * W, PIXEL_Y: 2 * H}).camera
    assert resized is not None
    assert resized.focal_length == pytest.approx(0.6 * 50)


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {LENGTH: 4},  # of a sensor of unknown size
        {IN_35MM: 0},
        {IN_35MM: 1},
        {IN_35MM: 60000},
        {LENGTH: IFDRational(0, 0), PLANE_X: IFDRational(0, 0)},
        {LENGTH: 4, PLANE_X: IFDRational(1, 0)},
        {LENGTH: 4, PLANE_X: 300, PLANE_UNIT: 9},
        {LENGTH: 4, PLANE_X: 1e30},
    ],
)
def test_absurd_values_are_ignored(tmp_path: Path, tags: dict[int, Any]) -> None:
    photo = jpeg(tmp_path, tags)
    assert photo.camera is None
    assert not photo.original.cropped


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_unreadable_metadata_are_ignored() -> None:
    raster = raster_of_codes(codes(), 255)
    damaged = exif({IN_35MM: 40}).tobytes()
    for length in range(len(damaged)):
        assert isinstance(with_focal_length(raster, damaged[:length]), Raster)
    for seed in range(200):
        rng = np.random.default_rng(seed)
        data = np.frombuffer(damaged, np.uint8).copy()
        data[rng.integers(6, len(data), 4)] = rng.integers(0, 256, 4)
        assert isinstance(with_focal_length(raster, data.tobytes()), Raster)


def test_a_cropped_photo_has_no_camera(tmp_path: Path) -> None:
    photo = jpeg(tmp_path, {IN_35MM: 26, PIXEL_X: W, PIXEL_Y: 2 * H})
    assert photo.camera is None
    assert photo.original.cropped
    turned = jpeg(tmp_path, {IN_35MM: 26, PIXEL_X: 10 * H, PIXEL_Y: 10 * W})
    assert turned.camera is not None


def test_resizing_keeps_every_ray(tmp_path: Path) -> None:
    photo = jpeg(tmp_path, {IN_35MM: 26})
    small = photo.resized_to_object(17)
    assert photo.camera is not None
    assert small.camera is not None
    column, row = 0.2 * W, 0.7 * H
    for full, scaled, at in zip(
        photo.camera.principal_point, small.camera.principal_point, (column, row), strict=True
    ):
        assert (at - full) / photo.camera.focal_length == pytest.approx(
            (at * small.scale - scaled) / small.camera.focal_length
        )
