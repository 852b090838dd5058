"""The photo's camera: its renders match the maps pixel by pixel."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from tests.addon.scene_fixture import bump, write_result
from tests.addon.scene_render import pixels, render


def build(result: ResultArrays, photo: Any = None, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options), photo=photo)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rows", "columns", "centre"),
    [(64, 88, (27.0, 38.0)), (88, 64, (50.0, 30.0)), (51, 51, (24.0, 25.0))],
)
def test_a_ray_through_a_pixel_meets_the_objects_point_there(
    blender: Any, tmp_path: Path, rows: int, columns: int, centre: tuple[float, float]
) -> None:
    result = read_result(write_result(tmp_path / "bump", bump(rows, columns, centre)))
    built = build(result, size_metres=0.7)
    layers = render(built.scene, tmp_path)
    assert layers["Combined"].shape[:2] == (rows, columns)
    row, column = result.vertex_pixel.T
    placed = layers["Position"][row, column] * result.longest_side / 0.7  # in pixels
    seen = layers["Combined"][row, column, 3] > 0.5
    x, y, z = (result.vertices / result.metres_per_pixel).T
    off = np.abs(placed - np.stack([x, -z, y], -1))[seen]
    assert seen.mean() > 0.9, "vertices on the very outline may be missed"
    assert off[:, [0, 2]].max() < 0.02 and np.median(off[:, 1]) < 0.02, "pixels"
    covered = np.zeros(result.mask.shape, bool)
    covered[row, column] = True
    assert not (layers["Combined"][..., 3] > 0)[~covered].any()


def test_the_camera_follows_an_object_that_was_moved(
    blender: Any, bump_folder: Path, tmp_path: Path
) -> None:
    result = read_result(bump_folder)
    built = build(result)
    before = render(built.scene, tmp_path)["Diffuse Color"]
    built.object.location, built.object.rotation_euler = (1.0, -2.0, 0.5), (0.3, 0.2, 1.0)
    built.object.scale = (1.5, 1.5, 1.5)
    built = build(result)
    assert tuple(built.object.location) == pytest.approx((1.0, -2.0, 0.5)), (
        "what people moved stays where it is"
    )
    np.testing.assert_allclose(render(built.scene, tmp_path)["Diffuse Color"], before, atol=0.01)


def test_deep_objects_are_not_clipped(blender: Any, bump_folder: Path, tmp_path: Path) -> None:
    result = read_result(bump_folder)
    deep = replace(result, vertices=result.vertices * np.array([1, 1, 60], np.float32))
    seen = render(build(deep).scene, tmp_path)["Combined"][..., 3]
    flat = render(build(result, name="flat").scene, tmp_path)["Combined"][..., 3]
    assert (seen > 0).sum() == (flat > 0).sum()


def test_the_photo_is_the_background_image(blender: Any, bump_folder: Path) -> None:
    result = read_result(bump_folder)
    built = build(result)
    (shown,) = built.camera.data.background_images
    assert built.camera.data.show_background_images and shown.display_depth == "BACK"
    masked = pixels(shown.image)
    np.testing.assert_allclose(masked[..., :3][result.mask], result.image[result.mask], rtol=1e-6)
    assert np.array_equal(masked[..., 3] > 0.5, result.mask)
    photo = blender.data.images.new("photo", 200, 150)
    theirs = built.camera.data.background_images.new()
    theirs.image = blender.data.images.new("theirs", 8, 8)
    for _ in range(2):
        built = build(result, photo=photo)
        assert [one.image.name for one in built.camera.data.background_images] == [
            "photo",
            "theirs",
        ]


@pytest.mark.parametrize("pinhole", [False, True], ids=["orthographic", "pinhole"])
def test_the_photos_frame_leaves_out_what_maps_have_beyond_it(
    blender: Any, bump_folder: Path, pinhole: bool
) -> None:
    """Maps of 88 x 64 pixels of a photo that is 87.5 x 63.25 of them."""
    result = replace(
        read_result(bump_folder), photo_size=np.array([350, 253], np.int32), crop_scale=0.25
    )
    if pinhole:
        result = replace(
            result,
            focal_length=120.0,
            principal_point=np.array([44.0, 32.0], np.float32),
            eye=np.array([0, 0, 120 * result.metres_per_pixel], np.float32),
        )
    step = 0.1 / result.longest_side
    whole = build(result).camera
    offset, scale, shift = whole.location.copy(), whole.data.ortho_scale, whole.data.shift_x
    part = build(result, photo_resolution=True).camera
    if pinhole:
        assert part.data.lens == pytest.approx(36 * 120 / 87.5)
        assert part.data.shift_x == pytest.approx((43.75 - 44) / 87.5)
        assert part.data.shift_y == pytest.approx((32 - 31.625) / 87.5) and shift == 0
    else:
        assert part.data.ortho_scale == pytest.approx(scale * 87.5 / 88)
        moved = (part.location - offset) / step
        assert (moved.x, moved.z) == pytest.approx((-0.25, 0.375), abs=1e-3)
