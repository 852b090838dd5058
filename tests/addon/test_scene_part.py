"""Arrays of the object's part of a large frame: the scene is that of the whole frame."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.result_files.arrays_file import write_arrays
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.part_of_result import ResultPart, placed_result
from tests.addon.scene_fixture import bump, write_result
from tests.addon.scene_render import pixels, render
from tests.core.perspective_scene import bump_before_camera

FRAME, CORNER = (330, 420), (230, 130)  # rows and columns; x and y of the fixture in it


def in_frame(d: Decomposition) -> Decomposition:
    (x, y), (rows, columns) = CORNER, d.mask.shape
    placed = placed_result(d, FramePart(slice(y, y + rows), slice(x, x + columns), FRAME))
    about = {**d.provenance.input, "size": list(FRAME[::-1])}
    return replace(placed, provenance=replace(d.provenance, input=about))


def of_whole_frame(result: ResultArrays) -> ResultArrays:
    """The arrays as earlier versions wrote them."""
    part = result.part
    (x, y), (height, width) = part.corner, part.shape
    rows, columns = result.mask.shape
    u, v = result.uv.astype(float).T
    maps = ("image", "diffuse", "specular", "residual", "reflectance", "shading", "lobe")
    values = {
        name: part.placed(getattr(result, name)) for name in (*maps, "height", "mask", "confidence")
    }
    up = np.array([0, 0, 1], np.float32)
    moved = None if result.principal_point is None else result.principal_point + _corner(part)
    return replace(
        result,
        **values,
        normal=part.placed(result.normal, up),
        base_color=part.placed(result.base_color, result.base_color[0, 0]),
        normal_map=part.placed(result.normal_map, result.normal_map[0, 0]),
        uv=np.stack([(x + u * columns) / width, 1 - (y + (1 - v) * rows) / height], -1).astype(
            np.float32
        ),
        vertex_pixel=result.vertex_pixel + np.array([y, x], np.int32),
        origin=result.origin + np.array([x, y, 0], np.float32),
        principal_point=moved,
        frame=None,
    )


def _corner(part: FramePart) -> np.ndarray:
    return np.array(part.corner, np.float32)


def build(result: ResultArrays, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options))


def arrays_of_part(folder: Path, d: Decomposition) -> ResultArrays:
    write_result(folder, d)
    write_arrays(ResultPart.of(d), folder / "arrays.npz")
    return read_result(folder)


@pytest.fixture
def flat(tmp_path: Path) -> ResultArrays:
    return arrays_of_part(tmp_path / "bump", in_frame(bump()))


@pytest.fixture
def before_camera(tmp_path: Path) -> ResultArrays:
    return arrays_of_part(tmp_path / "seen", in_frame(bump_before_camera()))


def test_arrays_are_those_of_the_objects_part(flat: ResultArrays) -> None:
    assert flat.size == FRAME[::-1]
    assert flat.mask.shape < FRAME
    assert flat.mask.sum() == bump().mask.sum()
    d = in_frame(bump())
    np.testing.assert_array_equal(flat.diffuse, flat.part.cut(d.diffuse))
    row, column = flat.vertex_pixel.T
    assert flat.mask[row, column].all()
    height, width = flat.mask.shape
    np.testing.assert_allclose(flat.uv[:, 0], (column + 0.5) / width, atol=1e-6)
    np.testing.assert_allclose(flat.uv[:, 1], 1 - (row + 0.5) / height, atol=1e-6)


@pytest.mark.parametrize("name", ["flat", "before_camera"])
@pytest.mark.parametrize(
    "options",
    [{}, {"displacement": True}, {"back": "rounded"}],
    ids=["mesh", "displacement", "solid"],
)
def test_the_scene_is_that_of_the_whole_frame(
    blender: Any, tmp_path: Path, request: Any, name: str, options: dict[str, Any]
) -> None:
    part: ResultArrays = request.getfixturevalue(name)
    assert part.mask.size < 0.5 * FRAME[0] * FRAME[1]
    whole = of_whole_frame(part)
    near, far = build(part, **options, name="part"), build(whole, **options, name="whole")
    # Before a camera, a solid is as large as asked, and its back differs slightly in another frame.
    rtol = 1e-3 if options.get("back") else 1e-6
    np.testing.assert_allclose(
        np.array(near.camera.matrix_world), np.array(far.camera.matrix_world), rtol, atol=1e-6
    )
    for value in ("lens", "ortho_scale", "shift_x", "shift_y", "clip_start", "clip_end"):
        expected = getattr(far.camera.data, value)
        assert getattr(near.camera.data, value) == pytest.approx(expected, rel=rtol)
    images = [render(built.scene, tmp_path)["Combined"] for built in (near, far)]
    assert images[0].shape[:2] == FRAME
    seen = [image[..., 3] > 0.5 for image in images]
    assert (seen[0] ^ seen[1]).sum() <= 0.01 * seen[0].sum()
    inside = seen[0] & seen[1]
    assert np.abs(images[0] - images[1])[inside].mean() < 0.002
    where = np.argwhere(inside)
    known = np.argwhere(part.part.placed(part.mask))
    assert np.abs(where.mean(0) - known.mean(0)).max() < 1


def test_the_photo_behind_it_covers_the_frame(blender: Any, flat: ResultArrays) -> None:
    (shown,) = build(flat).camera.data.background_images
    masked, d = pixels(shown.image), in_frame(bump())
    assert masked.shape[:2] == FRAME
    assert np.array_equal(masked[..., 3] > 0.5, d.mask)
    np.testing.assert_allclose(masked[..., :3][d.mask], d.image[d.mask], rtol=1e-6)


def test_objects_of_one_photo_are_in_their_places(flat: ResultArrays) -> None:
    from blender_addon.scene.objects import offset_between

    whole = of_whole_frame(flat)
    assert offset_between(whole, flat, 0.01) == pytest.approx((0, 0, 0), abs=1e-6)


@pytest.mark.parametrize("frame", [[-1, 0, 420, 330], [400, 0, 420, 330], [0, 0, 420, 20]])
def test_a_part_beyond_its_frame_is_refused(
    tmp_path: Path, flat: ResultArrays, frame: list[int]
) -> None:
    path = flat.folder / "arrays.npz"
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(path, **{**arrays, "frame": np.array(frame, np.int32)})
    with pytest.raises(InputError, match="is damaged"):
        read_result(flat.folder)


def test_a_copy_keeps_its_place_in_textures_of_another_part(
    flat: ResultArrays, blender: Any
) -> None:
    """With another mask, the textures cover another part of the photo; a copy has its own mesh."""
    from blender_addon.scene.hand_edits import is_edited_by_hand

    def uv(obj: Any) -> np.ndarray:
        return np.array([place.vector[:] for place in obj.data.uv_layers[0].uv])

    obj = build(flat, own_scene=False, all_maps=False).object
    copy, edited = obj.copy(), obj.copy()
    for one in (copy, edited):
        one.data = obj.data.copy()
        blender.context.scene.collection.objects.link(one)
    first = uv(obj)
    edited.data.uv_layers[0].data[0].uv = (2, 3)
    build(of_whole_frame(flat), own_scene=False, all_maps=False)
    np.testing.assert_allclose(uv(copy), uv(obj), atol=1e-6)
    np.testing.assert_allclose(uv(edited)[1:], uv(obj)[1:], atol=1e-6)
    assert np.abs(uv(copy) - first).max() > 0.1
    assert not is_edited_by_hand(copy) and is_edited_by_hand(edited)
