"""The mesh that Blender holds: places, normals, UV and confidence are the result's; the closed one
is closed, the displaced one alike.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from blender_addon.datablocks.quads import joined_quads
from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.result_files.mesh.options import MeshOptions
from tests.addon.scene_fixture import write_result


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
@pytest.mark.parametrize("back", ["flat", "rounded", "mirrored"])
def test_the_solid_mesh_is_closed(blender: Any, bump_folder: Path, back: str) -> None:
    result = read_result(bump_folder)
    assert not manifold(build(result, back="open").object.data)
    closed = build(result, back=back, triangles=900).object.data
    assert manifold(closed) and not closed.validate(verbose=True)
    places = got(closed.vertices, "co", 3).astype(float)
    closed.calc_loop_triangles()
    corner = places[got(closed.loop_triangles, "vertices", 3, np.int32)]
    assert np.linalg.det(corner).sum() > 0, "the faces look inward"
    assert places[:, 1].max() > -result.vertices[:, 2].min()
    assert crossing_faces(closed) == 0


def crossing_faces(mesh: Any) -> int:
    """Pairs of faces that cross each other without a common vertex, as 3D printing counts them."""
    import bmesh
    from mathutils.bvhtree import BVHTree

    edited = bmesh.new()
    edited.from_mesh(mesh)
    pairs = BVHTree.FromBMesh(edited, epsilon=0.0).overlap(BVHTree.FromBMesh(edited, epsilon=0.0))
    edited.free()
    corners = [set(face.vertices) for face in mesh.polygons]
    return sum(a < b and not corners[a] & corners[b] for a, b in pairs)


def test_the_front_of_the_solid_mesh_keeps_heights_and_normals(
    blender: Any, bump_folder: Path
) -> None:
    """Where there is a vertex at each pixel, all but the rim is the result's own mesh."""
    result = read_result(bump_folder)
    mesh = build(result, back="rounded", triangles=0).object.data
    places, uv = got(mesh.vertices, "co", 3), np.zeros((len(mesh.vertices), 2), np.float32)
    corners = got(mesh.loops, "vertex_index", 1, np.int32)
    uv[corners] = got(mesh.uv_layers["UVMap"].uv, "vector", 2)
    trust = got(mesh.attributes["confidence"].data, "value", 1)
    normals = got(mesh.attributes["custom_normal"].data, "vector", 3)
    height, width = result.mask.shape
    column, row = uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    at = np.full(result.mask.shape, -1)
    at[tuple(result.vertex_pixel.T)] = np.arange(len(result.vertices))
    front = np.flatnonzero(trust > 0.5)
    pixels = np.rint(row[front]).astype(int), np.rint(column[front]).astype(int)
    same, deep = at[pixels], ndimage.binary_erosion(result.mask, iterations=3)[pixels]
    assert len(front) > 0.7 * len(result.vertices) and (same >= 0).all()
    x, y, z = result.vertices[same].T
    own = np.stack([x, -z, y], -1)
    np.testing.assert_allclose(places[front][deep], own[deep], atol=1e-6)
    np.testing.assert_allclose(places[front][:, ::2], own[:, ::2], atol=1e-6)
    assert (places[front][:, 1] >= own[:, 1] - 1e-6).all(), "the last pixels roll off"
    nx, ny, nz = result.vertex_normals[same].T
    off = np.arccos(np.clip((normals[front] * np.stack([nx, -nz, ny], -1)).sum(-1), -1, 1))
    assert np.degrees(off).max() < 2, "normals are means over the triangles of a vertex"


def test_the_solid_mesh_has_few_triangles_and_a_normal_map(blender: Any, bump_folder: Path) -> None:
    result = read_result(bump_folder)
    many = len(build(result, back="open", triangles=0).object.data.polygons)
    built = build(result, back="open", triangles=many // 2)
    assert len(built.object.data.polygons) < 0.75 * many
    assert any(image.get("isc_role") == "normal_map" for image in blender.data.images)


def triangles_of(mesh: Any) -> set[tuple[int, ...]]:
    mesh.calc_loop_triangles()
    return set(map(tuple, np.sort(got(mesh.loop_triangles, "vertices", 3, np.int32)).tolist()))


@pytest.mark.parametrize("seed", range(3))
def test_halves_of_squares_become_quads_and_split_into_them_again(seed: int) -> None:
    """A grid of squares with any diagonals, on any surface, and triangles that fit none."""
    rng = np.random.default_rng(seed)
    rows, columns = 7, 9
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (
        number[r : r + rows - 1, k : k + columns - 1].ravel()
        for r, k in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    falls = rng.random(len(a)) < 0.5
    first = np.where(falls, [a, d, c], [a, d, b]).T
    second = np.where(falls, [a, c, b], [b, d, c]).T
    beside = np.array([[0, 1, rows * columns], [1, 2, rows * columns]])  # a place above the grid
    faces = np.concatenate([first, second, beside])
    faces = np.array([np.roll(face, rng.integers(3)) for face in rng.permutation(faces)])
    places = np.stack(np.indices((rows, columns)), -1).reshape(-1, 2).astype(float)
    corners, starts = joined_quads(faces, np.concatenate([places, [[-0.7, 1.2]]]))
    sizes = np.diff(np.append(starts, len(corners)))
    assert sizes.tolist() == [4] * len(a) + [3] * 2
    quads = corners[: 4 * len(a)].reshape(-1, 4)
    split = np.concatenate(
        [quads[:, :3], quads[:, [0, 2, 3]], corners[4 * len(a) :].reshape(-1, 3)]
    )

    def turned(triangles: np.ndarray) -> set[tuple[int, ...]]:
        return {tuple(np.roll(one, -one.argmin()).tolist()) for one in triangles}

    assert turned(split) == turned(faces), "the same triangles, with the same sides up"


@pytest.mark.parametrize("back", ["flat", "rounded", "open"])
def test_a_full_mesh_is_a_grid_of_quads(blender: Any, bump_folder: Path, back: str) -> None:
    from blender_addon.scene.solid_mesh import _solid

    result = read_result(bump_folder)
    mesh = build(result, back=back, triangles=0).object.data
    sizes = got(mesh.polygons, "loop_total", 1, np.int32)
    inside = ndimage.binary_erosion(result.mask, np.ones((3, 3)))
    assert (sizes == 4).sum() >= (1 if back == "open" else 2) * inside.sum()
    assert triangles_of(mesh) == set(
        map(tuple, np.sort(_solid(result, back, 0).mesh.faces).tolist())
    )


def test_the_solid_mesh_can_be_subdivided(blender: Any, bump_folder: Path) -> None:
    built = build(read_result(bump_folder), back="rounded", triangles=0)
    before = volume(built.object.data)
    built.object.modifiers.new("finer", "SUBSURF").levels = 1
    finer = evaluated(built)
    assert set(got(finer.polygons, "loop_total", 1, np.int32)) == {4} and manifold(finer)
    assert volume(finer) == pytest.approx(before, rel=0.01)


def volume(mesh: Any) -> float:
    places = got(mesh.vertices, "co", 3).astype(float)
    mesh.calc_loop_triangles()
    corner = places[got(mesh.loop_triangles, "vertices", 3, np.int32)]
    return float(np.linalg.det(corner).sum() / 6)


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


def test_linked_copies_follow_the_displacement(blender: Any, bump_folder: Path) -> None:
    """They share the flat grid, or the full mesh, so they need the modifier, or none."""
    from blender_addon.files.result_arrays import read_result
    from blender_addon.scene import BuildOptions, build_object

    result = read_result(bump_folder)
    depths: list[list[float]] = []
    for displacement in (False, True, False):
        options = BuildOptions(own_scene=False, all_maps=False, displacement=displacement)
        obj = build_object(result, options).object
        if not depths:
            copy = obj.copy()
            blender.context.scene.collection.objects.link(copy)
        graph = blender.context.evaluated_depsgraph_get()
        depths.append([one.evaluated_get(graph).dimensions.y for one in (obj, copy)])
        assert copy.data == obj.data and len(copy.modifiers) == int(displacement)
    assert np.ptp(depths) < 1e-5 and depths[0][0] > 0.01


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
