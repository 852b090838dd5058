"""The mesh that Blender holds: places, normals, UV and confidence are the result's; the closed one
is closed, the displaced one alike.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.result_files.mesh_options import MeshOptions
from tests.addon.scene_fixture import bump, write_result


def got(values: Any, name: str, width: int, kind: type = np.float32) -> np.ndarray:
    out: np.ndarray = np.empty(len(values) * width, kind)
    values.foreach_get(name, out)
    return out.reshape(-1, width) if width > 1 else out


def build(result: ResultArrays, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options))


def test_places_normals_uv_and_confidence_are_the_results(blender: Any, bump_folder: Path) -> None:
    result = read_result(bump_folder)
    mesh = build(result).object.data
    x, y, z = result.vertices.T
    np.testing.assert_allclose(got(mesh.vertices, "co", 3), np.stack([x, -z, y], -1), atol=1e-8)
    corners = got(mesh.loops, "vertex_index", 1, np.int32)
    assert np.array_equal(corners, result.faces.ravel())
    nx, ny, nz = result.vertex_normals.T
    np.testing.assert_allclose(
        got(mesh.corner_normals, "vector", 3), np.stack([nx, -nz, ny], -1)[corners], atol=1e-6
    )
    np.testing.assert_array_equal(got(mesh.uv_layers["UVMap"].uv, "vector", 2), result.uv[corners])
    trust = got(mesh.attributes["confidence"].data, "value", 1)
    np.testing.assert_array_equal(trust, result.confidence[tuple(result.vertex_pixel.T)])
    assert not mesh.validate(verbose=True), "Blender found something to repair"


@pytest.mark.parametrize("size", [0.1, 2.5])
def test_the_longer_side_has_the_given_size(blender: Any, bump_folder: Path, size: float) -> None:
    result = read_result(bump_folder)
    places = got(build(result, size_metres=size).object.data.vertices, "co", 3)
    pixel = size / result.longest_side
    # From the middle of the outermost pixel to that of the opposite one it is a pixel less.
    assert np.ptp(places, axis=0)[[0, 2]].max() == pytest.approx(size - pixel, rel=1e-5)


def manifold(mesh: Any) -> bool:
    """Whether each edge has two faces, which pass it in opposite directions, and each vertex one
    fan of faces.
    """
    corners = got(mesh.loops, "vertex_index", 1, np.int32)
    starts = got(mesh.polygons, "loop_start", 1, np.int32)
    edges: dict[tuple[int, int], int] = {}
    after: dict[int, dict[int, int]] = {}
    for face in np.split(corners, starts[1:]):
        for before, here, behind in zip(np.roll(face, 1), face, np.roll(face, -1), strict=True):
            edges[here, behind] = edges.get((here, behind), 0) + 1
            after.setdefault(here, {})[behind] = before
    if any(count != 1 or (b, a) not in edges for (a, b), count in edges.items()):
        return False
    for turn in after.values():
        start = next(iter(turn))
        here, steps = turn[start], 1
        while here != start:
            here, steps = turn[here], steps + 1
        if steps != len(turn):
            return False
    return True


@pytest.mark.slow
def test_the_closed_body_is_closed(blender: Any, bump_folder: Path) -> None:
    result = read_result(bump_folder)
    opened = build(result).object.data
    assert not manifold(opened)
    closed = build(result, closed_back=True).object.data
    assert manifold(closed) and not closed.validate(verbose=True)
    places = got(closed.vertices, "co", 3).astype(float)
    closed.calc_loop_triangles()
    corner = places[got(closed.loop_triangles, "vertices", 3, np.int32)]
    volume = np.linalg.det(corner).sum() / 6
    assert volume > 0, "the faces look inward"
    assert places[:, 1].max() > -result.vertices[:, 2].min()


@pytest.mark.slow
def test_parts_that_meet_in_a_vertex_are_closed_too(blender: Any, tmp_path: Path) -> None:
    mask = np.zeros((64, 88), bool)
    mask[5:20, 10:31] = mask[19:40, 30:50] = (
        True  # two blocks whose cells share the vertex (19, 30)
    )
    mask[8:12, 15:18] = False
    d = bump()
    zero = np.zeros_like(d.height)
    result = read_result(write_result(tmp_path / "pinched", replace(d, mask=mask, height=zero)))
    closed = build(result, closed_back=True).object.data
    assert len(closed.vertices) == 2 * (len(result.vertices) + 1), "the shared vertex was not split"
    assert manifold(closed)


def test_the_front_of_the_closed_body_keeps_its_normals(blender: Any, bump_folder: Path) -> None:
    result = read_result(bump_folder)
    closed = build(result, closed_back=True).object.data
    normals = got(closed.corner_normals, "vector", 3)
    nx, ny, nz = result.vertex_normals.T
    front = np.stack([nx, -nz, ny], -1)[result.faces.ravel()]
    np.testing.assert_allclose(normals[: len(front)], front, atol=1e-6)
    np.testing.assert_allclose(
        normals[len(front) : 2 * len(front)], np.broadcast_to([0, 1, 0], front.shape), atol=1e-6
    )
    wall = normals[2 * len(front) :]
    corners = got(closed.loops, "vertex_index", 1, np.int32)[2 * len(front) :]
    places = got(closed.vertices, "co", 3)[corners]
    middle = got(closed.vertices, "co", 3).mean(0)
    assert (((places - middle) * wall)[:, [0, 2]].sum(-1) > 0).all(), (
        "the wall's normals look inward"
    )


@pytest.mark.slow
@pytest.mark.parametrize("faces", [525_000, 900])
def test_the_displaced_grid_is_the_height_mesh(blender: Any, tmp_path: Path, faces: int) -> None:
    """Also where the mesh takes every n-th pixel only."""
    result = read_result(write_result(tmp_path / "bump", mesh=MeshOptions(triangles=faces)))
    exact = got(build(result).object.data.vertices, "co", 3)
    built = build(result, displacement=True)
    assert np.ptp(got(built.object.data.vertices, "co", 3)[:, 1]) == 0
    lifted = evaluated(built)
    displaced = got(lifted.vertices, "co", 3)
    np.testing.assert_allclose(displaced, exact, atol=1e-6 * 0.1)
    flat = np.repeat(got(lifted.polygons, "normal", 3), 3, axis=0)
    assert np.abs(got(lifted.corner_normals, "vector", 3) - flat).max() > 0.02, (
        "the faces are not smooth"
    )
    build(result)
    assert not built.object.modifiers and len(blender.data.textures) == 0


def test_the_mesh_can_be_decimated(blender: Any, bump_folder: Path) -> None:
    """A fifth of the faces still has the recovered normals, which for the bump are known
    everywhere.
    """
    result = read_result(bump_folder)
    built = build(result)
    built.object.modifiers.new("fewer", "DECIMATE").ratio = 0.2
    fewer = evaluated(built)
    assert len(fewer.polygons) < 0.25 * len(built.object.data.polygons)
    places = (
        got(fewer.vertices, "co", 3)[got(fewer.loops, "vertex_index", 1, np.int32)]
        / result.metres_per_pixel
    )
    x, y = (
        (places[:, 0] + result.origin[0] - 38) / 25.6,
        (27 - result.origin[1] + places[:, 2]) / 25.6,
    )
    wanted = np.stack([x, -np.ones_like(x), y], -1) / np.sqrt(1 + x * x + y * y)[:, None]
    turned = np.rad2deg(
        np.arccos(np.clip((got(fewer.corner_normals, "vector", 3) * wanted).sum(-1), -1, 1))
    )
    assert np.percentile(turned, 95) < 4, "degrees"


def evaluated(built: Any) -> Any:
    """The mesh as its modifiers leave it."""
    graph = built.scene.view_layers[0].depsgraph
    graph.update()
    return built.object.evaluated_get(graph).data
