"""The maps as files: of a large frame, they store the object's part, and nothing is lost."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.io.exr import read_windowed, write_channels
from isc_core.photo.camera import Camera
from isc_core.result_files.arrays_file import ARRAYS
from isc_core.result_files.maps_file import (
    EXPECTED_ERROR,
    MAPS,
    SINGLE,
    StoredMaps,
    map_channels,
    stored_part,
)
from isc_core.result_files.result_folder import load, load_part, save, save_separation
from isc_core.scene.decomposition import Decomposition, Separation
from isc_core.scene.expected_error import ExpectedError
from isc_core.scene.part_of_result import ResultPart, cut_result, placed_result
from tests.core.ball_scene import ball

FRAME = (1500, 1600)
PLACE = FramePart(slice(700, 748), slice(1100, 1160), FRAME)


def in_a_large_frame() -> Decomposition:
    """A ball in a corner of a frame, with all optional layers."""
    d = ball((48, 60), 20.0, (22, 33))
    inside = d.mask[..., None]
    error = ExpectedError(np.where(d.mask, np.float32(14.5), 0), 0.2 * d.confidence)
    d = replace(
        d,
        expected_error=error,
        visibility=np.where(inside, 0.5, 1.0).repeat(3, -1).astype(np.float32),
        indirect=np.where(inside, 0.25, 0.0).repeat(3, -1).astype(np.float32),
    )
    return placed_result(d, PLACE)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("result") / "ball"
    save(in_a_large_frame(), folder)
    return folder


def assert_equal(after: Decomposition, before: Decomposition) -> None:
    compared = 0
    for field in fields(before):
        values = getattr(before, field.name)
        if isinstance(values, np.ndarray):
            found = getattr(after, field.name)
            assert found.shape == values.shape and found.dtype == values.dtype, field.name
            assert (found == values).all(), field.name
            compared += 1
    assert compared >= 13
    error = after.expected_error
    assert error is not None and before.expected_error is not None
    assert (error.normal == before.expected_error.normal).all()
    assert (error.reflectance == before.expected_error.reflectance).all()


def windows(path: Path) -> tuple[list[int], list[int]]:
    """Data and display window, as (left, top, right, bottom)."""
    with OpenEXR.File(str(path)) as file:
        data, display = (
            np.ravel(file.header()[key]).tolist() for key in ("dataWindow", "displayWindow")
        )
    return data, display


def test_files_of_a_large_frame_store_the_object_with_a_pixel_around_it(saved: Path) -> None:
    rows, columns = np.nonzero(in_a_large_frame().mask)
    box = [columns.min() - 1, rows.min() - 1, columns.max() + 1, rows.max() + 1]
    for name in (MAPS, *(f"maps/{layer}.exr" for layer in SINGLE)):
        assert windows(saved / name) == (box, [0, 0, FRAME[1] - 1, FRAME[0] - 1]), name
    assert (saved / MAPS).stat().st_size < 1 << 19


def test_they_are_read_back_in_the_frame_bit_by_bit(saved: Path) -> None:
    assert_equal(load(saved), in_a_large_frame())


def test_the_part_alone_can_be_read(tmp_path: Path) -> None:
    d = replace(in_a_large_frame(), camera=Camera(900.3, (800.3, 750.0)))
    save(d, tmp_path / "ball")
    found = load_part(tmp_path / "ball")
    assert found.part == stored_part(d.mask)
    assert_equal(found.result, cut_result(d, found.part))
    assert found.result.camera == cut_result(d, found.part).camera
    assert load(tmp_path / "ball").camera == d.camera


@pytest.mark.slow
@pytest.mark.parametrize("before_camera", [False, True])
def test_the_files_of_a_part_are_those_of_its_frame(tmp_path: Path, before_camera: bool) -> None:
    """Also with a soft rim, whose coverage extends beyond the part."""
    d = in_a_large_frame()
    given = {**d.provenance.input, "scale": 1.0, "mask_from": "alpha"}
    d = replace(d, provenance=replace(d.provenance, input=given))
    if before_camera:
        d = replace(d, camera=Camera(900.3, (800.25, 750.0)))
    row, column = np.indices(FRAME)
    away = np.hypot(row - 722, column - 1133) - 0.99 * 20
    cover = np.clip(0.5 - away / np.where(column > 1133, 14, 1), 0, 1)
    cover[:50, :50] = 0.5  # another thing
    part = FramePart(slice(690, 750), slice(1090, 1170), FRAME)
    save(d, tmp_path / "whole", cover=cover, arrays=True, png=True)
    near = cut_result(d, part)
    save(near, tmp_path / "part", cover=cover, arrays=True, png=True, part=part)
    files = [path.relative_to(tmp_path / "whole") for path in (tmp_path / "whole").rglob("*.*")]
    assert len(files) > 15 and Path(ARRAYS) in files
    with np.load(tmp_path / "part" / ARRAYS) as arrays:
        assert arrays["soft"].any()
    for name in files:
        part_file, whole_file = (tmp_path / of / name for of in ("part", "whole"))
        assert part_file.read_bytes() == whole_file.read_bytes(), name


@pytest.mark.parametrize("margin", [1, 200])
def test_a_part_can_be_seen_in_any_other_part(margin: int) -> None:
    d = in_a_large_frame()
    stored = ResultPart(cut_result(d, PLACE), PLACE)
    part = FramePart.around(d.mask, margin)
    assert part.within(PLACE).is_whole == (margin == 200)
    assert_equal(stored.at(part), cut_result(d, part))
    assert_equal(stored.at(FramePart.whole(FRAME)), d)
    assert np.array_equal(stored.mask, d.mask)


def test_files_that_store_the_whole_frame_are_read_too(saved: Path, tmp_path: Path) -> None:
    """Results of earlier versions."""
    d = in_a_large_frame()
    for file in ("decomposition.json", "mesh.glb"):
        (tmp_path / file).write_bytes((saved / file).read_bytes())
    write_channels(tmp_path / MAPS, map_channels(d))
    assert windows(tmp_path / MAPS)[0] == [0, 0, FRAME[1] - 1, FRAME[0] - 1]
    assert_equal(load(tmp_path), d)


def test_a_small_frame_is_stored_whole(tmp_path: Path) -> None:
    d = ball((48, 60), 5.0, (22, 33))
    assert stored_part(d.mask).is_whole
    save(d, tmp_path / "small")
    assert windows(tmp_path / "small" / MAPS) == ([0, 0, 59, 47],) * 2


def test_a_large_object_is_stored_in_its_whole_frame() -> None:
    assert stored_part(np.ones(FRAME, bool)).is_whole


def test_data_outside_the_frame_are_no_result(saved: Path, tmp_path: Path) -> None:
    stored = StoredMaps.read(saved / MAPS)
    for corner in ((-1, 0), (0, -1), (FRAME[1] - 10, 0), (0, FRAME[0] - 10)):
        write_channels(tmp_path / MAPS, stored.channels, corner, FRAME)
        with pytest.raises(InputError, match="data outside its frame"):
            StoredMaps.read(tmp_path / MAPS)


def test_a_frame_beyond_the_limit_is_refused_before_it_is_allocated(tmp_path: Path) -> None:
    channels = {f"layer{k}.Y": np.ones((4, 4), np.float32) for k in range(40)}
    write_channels(tmp_path / MAPS, channels, (0, 0), (8000, 8000))
    with pytest.raises(InputError, match=r"unpacks to 10\.2 GB"):
        StoredMaps.read(tmp_path / MAPS)


def test_the_error_layers_have_names_of_their_own(saved: Path) -> None:
    assert set(EXPECTED_ERROR) < set(read_windowed(saved / MAPS).channels)


def test_a_separation_of_a_large_frame_stores_the_object_too(tmp_path: Path) -> None:
    d = in_a_large_frame()
    split = Separation(d.diffuse, d.specular, d.residual, d.confidence)
    image = np.where(d.mask[..., None], d.image, np.float32(0.3))
    save_separation(split, image, tmp_path / "out", mask=d.mask)
    data, display = windows(tmp_path / "out" / "separation.exr")
    assert display == [0, 0, FRAME[1] - 1, FRAME[0] - 1]
    assert data == windows_of(d.mask)
    found = read_windowed(tmp_path / "out" / "separation.exr")
    part = stored_part(d.mask)
    for index, letter in enumerate("RGB"):
        assert (found.channels[f"diffuse.{letter}"] == part.cut(d.diffuse)[..., index]).all()
    with Image.open(tmp_path / "out" / "diffuse.png") as picture:
        codes = np.asarray(picture)
    assert codes.shape == (*FRAME, 3)
    assert codes[d.mask].any() and not codes[~d.mask].any()


def windows_of(mask: np.ndarray) -> list[int]:
    part = stored_part(mask)
    return [part.columns.start, part.rows.start, part.columns.stop - 1, part.rows.stop - 1]


def test_a_result_without_an_object_is_damaged(saved: Path, tmp_path: Path) -> None:
    (tmp_path / "decomposition.json").write_bytes((saved / "decomposition.json").read_bytes())
    stored = StoredMaps.read(saved / MAPS)
    empty = {**stored.channels, "mask.A": 0 * stored.channels["mask.A"]}
    write_channels(tmp_path / MAPS, empty, stored.part.corner, FRAME)
    with pytest.raises(InputError, match="has an empty mask: it is damaged"):
        load(tmp_path)
