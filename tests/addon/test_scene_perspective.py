"""Objects before a pinhole camera: what Blender sees is what the photo shows."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from blender_addon.scene.hand_edits import is_edited_by_hand
from isc_core.errors import InputError
from isc_core.photo.camera import Camera
from isc_core.result_files.arrays_file import mesh_of, write_arrays
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.result_folder import save
from isc_core.scene.part_of_result import ResultPart
from isc_core.shading.perspective import lifted_points, object_axis
from tests.addon.scene_render import render
from tests.core.perspective_scene import CAMERA, bump_before_camera

SHIFTED = Camera(70.0, (39.2, 33.7))


@pytest.fixture
def result(tmp_path: Path, request: Any) -> ResultArrays:
    """The bump before a camera, as the worker writes it."""
    camera = getattr(request, "param", CAMERA)
    save(bump_before_camera(camera), tmp_path / "bump", arrays=True)
    return read_result(tmp_path / "bump")


def build(result: ResultArrays, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options))


def seen_pixels(built: Any, points: np.ndarray) -> np.ndarray:
    """(N, 2): row and column at which the camera sees points (N, 3) of the object."""
    from bpy_extras.object_utils import world_to_camera_view  # type: ignore[import-not-found]
    from mathutils import Vector

    built.scene.view_layers[0].update()
    matrix = built.object.matrix_world
    render_size = built.scene.render
    width, height = render_size.resolution_x, render_size.resolution_y
    places = [
        world_to_camera_view(built.scene, built.camera, matrix @ Vector(point)) for point in points
    ]
    return np.array([(height * (1 - y) - 0.5, width * x - 0.5) for x, y, _ in places])


def evaluated_vertices(built: Any) -> np.ndarray:
    """(V, 3): the vertices after modifiers."""
    built.scene.view_layers[0].update()
    mesh = built.object.evaluated_get(built.scene.view_layers[0].depsgraph).data
    values = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


@pytest.mark.parametrize("result", [CAMERA, SHIFTED], indirect=True)
@pytest.mark.parametrize("moved", [False, True])
def test_each_vertex_is_seen_at_its_pixel(blender: Any, result: ResultArrays, moved: bool) -> None:
    built = build(result, size_metres=0.7)
    if moved:
        built.object.location, built.object.rotation_euler = (1.0, -2.0, 0.5), (0.3, 0.2, 1.0)
        built.object.scale = (1.5, 1.5, 1.5)
        built = build(result, size_metres=0.7)
    assert built.camera.data.type == "PERSP"
    vertices = evaluated_vertices(built)
    off = seen_pixels(built, vertices) - result.vertex_pixel
    assert np.abs(off).max() < 0.01


@pytest.mark.parametrize("back", ["", "open", "flat", "rounded", "mirrored"])
def test_the_longer_side_has_the_given_size(blender: Any, result: ResultArrays, back: str) -> None:
    """Although the outline and the back of the object are farther away than its middle."""
    for _ in range(2):
        built = build(result, size_metres=0.7, back=back)
        vertices = evaluated_vertices(built)
        assert max(np.ptp(vertices, axis=0)[[0, 2]]) == pytest.approx(
            0.7, rel=1e-4 if back else 0.03
        )
        assert not is_edited_by_hand(built.object)
    front = seen_pixels(built, vertices)[vertices[:, 1].argmin()]
    assert result.mask[tuple(np.rint(front).astype(int))]


def test_a_displaced_grid_is_seen_alike_at_any_strength(blender: Any, result: ResultArrays) -> None:
    expected = evaluated_vertices(build(result, name="mesh"))
    built = build(result, displacement=True, name="grid")
    np.testing.assert_allclose(evaluated_vertices(built), expected, atol=1e-6)
    built.object.modifiers[0].strength = 0.3
    changed = evaluated_vertices(built)
    assert np.abs(changed - expected).max() > 1e-3
    assert np.abs(seen_pixels(built, changed) - result.vertex_pixel).max() < 0.01


def test_a_closed_back_is_hidden_by_the_front(blender: Any, result: ResultArrays) -> None:
    built = build(result, back="flat")
    vertices = evaluated_vertices(built)
    seen = seen_pixels(built, vertices)
    count = len(vertices) // 2
    assert np.abs(seen[count:] - seen[:count]).max() < 0.01
    assert np.ptp(vertices[count:, 1]) < 1e-5
    assert vertices[count:, 1].min() > vertices[:count, 1].max()


def test_every_pixel_has_its_height_if_the_mesh_of_the_result_has_fewer_vertices(
    blender: Any, tmp_path: Path
) -> None:
    """As the mesh of an object of more than 50,000 pixels has."""
    d, few = bump_before_camera(), MeshOptions(triangles=200)
    save(d, tmp_path / "bump", arrays=True, mesh=few)
    result = read_result(tmp_path / "bump")
    camera, inner = result.camera, _eroded(result.mask)
    assert camera is not None
    points = lifted_points(result.height, camera, object_axis(camera, result.mask))
    built = build(result, back="open", triangles=0)
    seen = evaluated_vertices(built) - np.array(built.camera.matrix_world.translation)
    pixels = np.rint(seen_pixels(built, evaluated_vertices(built))).astype(int)
    row, column = pixels[inner[tuple(pixels.T)]].T
    assert len(row) == inner.sum() > 2 * len(result.vertices)
    found, expected = seen[inner[tuple(pixels.T)], 1], -points[row, column, 2]
    ratio = found / expected
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=1e-5)


def _eroded(mask: np.ndarray) -> np.ndarray:
    """Without the rings whose heights the mesh limits."""
    for _ in range(3):
        mask = np.pad(mask, 1)
        mask = np.logical_and.reduce(
            [mask[i : i - 2 or None, j : j - 2 or None] for i in range(3) for j in range(3)]
        )
    return mask


def test_the_other_type_of_camera_replaces_the_first(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    save(bump_before_camera(None), tmp_path / "bump", arrays=True)
    flat = read_result(tmp_path / "bump")
    assert flat.focal_length is None
    for one, kind in ((flat, "ORTHO"), (result, "PERSP"), (flat, "ORTHO")):
        built = build(one)
        assert built.camera.data.type == kind
        off = seen_pixels(built, evaluated_vertices(built)) - one.vertex_pixel
        assert np.abs(off).max() < 0.01


def test_half_a_camera_is_refused(tmp_path: Path) -> None:
    d = bump_before_camera()
    save(d, tmp_path / "bump")
    write_arrays(
        ResultPart.of(d),
        tmp_path / "bump" / "arrays.npz",
        replace(mesh_of(ResultPart.of(d)), camera=CAMERA),
    )
    arrays = dict(np.load(tmp_path / "bump" / "arrays.npz"))
    del arrays["eye"]
    np.savez(tmp_path / "bump" / "arrays.npz", **arrays)
    with pytest.raises(InputError, match="half a camera"):
        read_result(tmp_path / "bump")


@pytest.mark.slow
def test_a_render_shows_the_object_where_the_photo_does(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    built = build(result, size_metres=0.7)
    layers = render(built.scene, tmp_path)
    row, column = result.vertex_pixel.T
    seen = layers["Combined"][row, column, 3] > 0.5
    assert seen.mean() > 0.9, "vertices on the very outline may be missed"
    placed = layers["Position"][row, column] / 0.7 * result.longest_side  # in pixels
    x, y, z = (result.vertices / result.metres_per_pixel).T
    off = np.abs(placed - np.stack([x, -z, y], -1))[seen]
    assert np.median(off) < 0.02 and np.percentile(off, 95) < 0.1, "pixels"
    covered = np.zeros(result.mask.shape, bool)
    covered[row, column] = True
    assert not (layers["Combined"][..., 3] > 0)[~covered].any()


@pytest.mark.slow
def test_a_render_in_the_recovered_light_looks_like_the_photo(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    from isc_core.evaluation.metrics import psnr

    built = build(result, specular_from="none")
    layers = render(built.scene, tmp_path, samples=64)
    diffuse = layers["Diffuse Direct"] * layers["Diffuse Color"]
    inside = result.mask.copy()
    inside[1:-1, 1:-1] &= result.mask[:-2, 1:-1] & result.mask[2:, 1:-1]
    inside[1:-1, 1:-1] &= result.mask[1:-1, :-2] & result.mask[1:-1, 2:]
    peak = float(np.percentile(result.diffuse[inside], 99.5))
    assert psnr(result.diffuse, diffuse, inside, peak=peak) > 25
