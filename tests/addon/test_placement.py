"""Where an object arrives in a scene that is not its own, and what comes along."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from mathutils import Euler, Vector  # noqa: E402 (after the skip)

from blender_addon.files.result_arrays import ResultArrays, read_result  # noqa: E402
from blender_addon.operators.viewport import find_view, front_view, show  # noqa: E402
from blender_addon.scene.build import build_object  # noqa: E402
from blender_addon.scene.built_object import find_built  # noqa: E402
from blender_addon.scene.hand_edits import is_edited_by_hand  # noqa: E402
from blender_addon.scene.placement import _sample, _winding_number  # noqa: E402
from blender_addon.scene.preparation import BuildOptions  # noqa: E402

SHARED = BuildOptions(own_scene=False, size_metres=1.0)


@pytest.fixture
def result(blender: Any, bump_folder: Path) -> ResultArrays:
    """The bump, in an empty file."""
    return read_result(bump_folder)


def bounds(obj: Any) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and the highest corner of an object in the world."""
    bpy.context.view_layer.update()
    corners = np.array([obj.matrix_world @ Vector(corner) for corner in obj.bound_box])
    return corners.min(0), corners.max(0)


def cube(size: float, place: tuple[float, float, float], inward: bool = False) -> Any:
    bpy.ops.mesh.primitive_cube_add(size=size, location=place)
    if inward:
        bpy.context.object.data.flip_normals()
    return bpy.context.object


def test_a_new_object_stands_on_the_cursor(result: ResultArrays) -> None:
    bpy.context.scene.cursor.location = (3, -2, 0.5)
    low, high = bounds(build_object(result, SHARED).object)
    np.testing.assert_allclose([*((low + high) / 2)[:2], low[2]], [3, -2, 0.5], atol=1e-5)
    assert max(high - low) == pytest.approx(1, abs=0.03)


def test_an_object_that_is_updated_stays_where_it_is(result: ResultArrays) -> None:
    obj = build_object(result, SHARED).object
    obj.location = (5, 6, 7)
    bpy.context.scene.cursor.location = (1, 1, 1)
    assert build_object(result, SHARED).object.location == Vector((5, 6, 7))


@pytest.mark.parametrize("size", [0.1, 1.0])
def test_the_cube_of_a_new_file_does_not_enclose_it(result: ResultArrays, size: float) -> None:
    blocks = [cube(2, (0, 0, 0)), cube(2, (2, 0, 0))]
    obj = build_object(result, BuildOptions(own_scene=False, size_metres=size)).object
    low, high = bounds(obj)
    for block in blocks:
        block_low, block_high = bounds(block)
        assert (low > block_high).any() or (high < block_low).any(), block.name
    assert low[2] == pytest.approx(0, abs=1e-5), "beside it, at the same height"


@pytest.mark.parametrize(
    "prepare",
    [
        lambda: cube(20, (0, 0, 0), inward=True),  # a room
        lambda: cube(2, (0, 0, -1)),  # a table
        lambda: setattr(cube(2, (0, 0, 0)), "hide_viewport", True),
        lambda: setattr(cube(2, (0, 0, 0)), "display_type", "WIRE"),
    ],
)
def test_rooms_tables_and_hidden_objects_leave_it_on_the_cursor(
    result: ResultArrays, prepare: Any
) -> None:
    prepare()
    low, high = bounds(build_object(result, SHARED).object)
    np.testing.assert_allclose([*((low + high) / 2)[:2], low[2]], 0, atol=1e-5)


def ball(segments: int, inward: bool = False) -> Any:
    """A ball of radius 2 about the origin, of segments^2 / 2 faces, scaled and turned."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=segments // 2, radius=1)
    obj = bpy.context.object
    if inward:
        obj.data.flip_normals()
    obj.scale, obj.rotation_euler = (2, 2, 2), (0.3, 0.2, 0.1)
    bpy.context.view_layer.update()
    return obj


@pytest.mark.parametrize("segments", [16, 256])
@pytest.mark.parametrize("inward", [False, True])
def test_a_surface_surrounds_what_is_in_it(blender: Any, segments: int, inward: bool) -> None:
    obj, sign = ball(segments, inward), -1 if inward else 1
    exact = segments == 16
    for x, wanted in ((0.0, 1), (1.0, 1), (1.7, 1), (2.3, 0), (4.0, 0)):
        found = _winding_number(obj, Vector((x, 0.1, -0.2)))
        assert found == pytest.approx(sign * wanted, abs=1e-4 if exact else 0.2), x


def test_a_new_object_leaves_a_ball_of_many_faces_and_stays_in_such_a_room(
    result: ResultArrays,
) -> None:
    obj = ball(256)
    low, _ = bounds(build_object(result, SHARED).object)
    assert low[0] > 2, "beside it"
    obj.data.flip_normals()
    other = BuildOptions(own_scene=False, size_metres=0.5, name="other")
    low, high = bounds(build_object(result, other).object)
    np.testing.assert_allclose([*((low + high) / 2)[:2], low[2]], 0, atol=1e-5)


def test_a_second_object_stands_beside_the_first(result: ResultArrays) -> None:
    """A body of the extension has 100,000 faces: to sort them blocks the window."""
    options = [
        BuildOptions(own_scene=False, size_metres=1, back="rounded", triangles=0, name=name)
        for name in ("one", "two")
    ]
    (_, high), (low, _) = (bounds(build_object(result, one).object) for one in options)
    assert low[0] > high[0]


def test_a_mesh_without_faces_surrounds_nothing(blender: Any) -> None:
    obj = cube(2, (0, 0, 0))
    blender.ops.object.mode_set(mode="EDIT")
    assert abs(_winding_number(obj, Vector())) < 1.001, "whatever Blender shows of it"
    blender.ops.object.mode_set(mode="OBJECT")
    obj.data.clear_geometry()
    blender.context.view_layer.update()
    assert _winding_number(obj, Vector()) == 0


def test_of_a_large_mesh_few_faces_stand_for_all(blender: Any) -> None:
    mesh = ball(256).data
    triangles, weight = _sample(mesh)
    assert len(triangles) <= 2000, "read while the window waits"
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2
    # Blender orders the faces of a new sphere differently each time; the deviation is 1 %.
    assert weight * area == pytest.approx(4 * np.pi, rel=0.06)


def test_light_and_camera_wait_in_a_collection_that_is_unchecked(result: ResultArrays) -> None:
    scene = bpy.context.scene
    before = scene.world, scene.camera, scene.render.resolution_x
    built = build_object(result, SHARED)
    assert (scene.world, scene.camera, scene.render.resolution_x) == before
    (part,) = built.collection.children
    assert sorted(obj.type for obj in part.objects) == ["CAMERA", "LIGHT"]
    assert [obj.name for obj in bpy.context.view_layer.objects] == [built.object.name]
    entry = bpy.context.view_layer.layer_collection.children[built.collection.name].children[0]
    assert entry.exclude
    entry.exclude = False
    build_object(result, SHARED)
    assert not entry.exclude, "the user's choice is kept"
    assert len(bpy.context.view_layer.objects) == 3


def test_an_object_stays_in_the_collections_that_the_user_chose(result: ResultArrays) -> None:
    built = build_object(result, SHARED)
    props = bpy.data.collections.new("props")
    bpy.context.scene.collection.children.link(props)
    assert built.camera is not None
    for obj in (built.object, built.camera):
        for collection in obj.users_collection:
            collection.objects.unlink(obj)
        props.objects.link(obj)
    build_object(result, SHARED)
    assert built.object.users_collection == built.camera.users_collection == (props,)
    shot = bpy.data.scenes.new("shot")
    shot.collection.children.link(props)
    bpy.context.scene.collection.children.unlink(props)
    again = build_object(result, SHARED, scene=shot)
    assert again.object == built.object and built.object.users_scene == (shot,)
    assert not shot.collection.children.get("bump"), "the scene has the object already"
    build_object(result, SHARED)
    assert set(built.object.users_scene) == {shot, bpy.context.scene}, "it was to be built here"


def test_an_object_is_updated_in_the_current_scene(result: ResultArrays) -> None:
    built = build_object(result, SHARED)
    backup = bpy.data.scenes.new("A backup, first in the list")
    backup.collection.objects.link(built.object)
    assert built.object.users_scene[0] == backup
    found = find_built(built.object)
    assert found is not None and found.scene == bpy.context.scene
    bpy.context.window.scene = backup
    found = find_built(built.object)
    assert found is not None and found.scene == backup


def test_the_camera_follows_an_object_with_a_parent(result: ResultArrays) -> None:
    built = build_object(result, SHARED)
    parent = bpy.data.objects.new("parent", None)
    bpy.context.scene.collection.objects.link(parent)
    assert built.camera is not None
    before = built.camera.location.copy()
    for obj in (built.object, built.camera):
        obj.parent = parent
    parent.location.x = 5
    bpy.context.view_layer.update()
    build_object(result, SHARED)
    bpy.context.view_layer.update()
    wanted = before + Vector((5, 0, 0))
    assert (built.camera.matrix_world.translation - wanted).length < 1e-5
    built.camera.parent = None
    build_object(result, SHARED)
    assert (built.camera.location - wanted).length < 1e-5


def test_a_wanted_camera_or_sun_is_in_the_scene_at_once(result: ResultArrays) -> None:
    built = build_object(result, BuildOptions(own_scene=False, set_camera=True, sun=True))
    assert bpy.context.scene.camera == built.camera
    bpy.context.view_layer.update()
    seen = {obj.type for obj in bpy.context.view_layer.objects}
    assert seen == {"MESH", "CAMERA", "LIGHT"}


def test_neither_light_nor_camera_is_made_if_not_wanted(result: ResultArrays) -> None:
    built = build_object(result, BuildOptions(own_scene=False, light_and_camera=False))
    assert built.camera is None and not bpy.data.cameras and not bpy.data.lights
    assert not built.collection.children


def test_renders_can_have_the_photos_resolution(result: ResultArrays) -> None:
    object.__setattr__(result, "photo_size", np.array([352, 256], np.int32))
    scene = build_object(result, BuildOptions(photo_resolution=True)).scene
    assert (scene.render.resolution_x, scene.render.resolution_y) == (352, 256)


def test_a_new_scene_previews_quickly(result: ResultArrays) -> None:
    scene = build_object(result).scene
    assert scene.cycles.preview_samples == 32 and scene.cycles.use_preview_denoising


def test_maps_that_nothing_uses_are_left_out(result: ResultArrays) -> None:
    obj = build_object(result, SHARED).object
    assert "isc_map_shading" in obj
    images = len(bpy.data.images)
    build_object(result, BuildOptions(own_scene=False, all_maps=False))
    left = sorted(name for name in obj.keys() if name.startswith("isc_map_"))  # noqa: SIM118
    assert left == ["isc_map_height", "isc_map_mask", "isc_map_specular"]
    assert len(bpy.data.images) == images - 7, "no map of an earlier result stays"


def test_hand_edits_are_noticed(result: ResultArrays) -> None:
    obj = build_object(result, SHARED).object
    assert not is_edited_by_hand(obj)
    obj.location.x, obj.data.name = 3, "mine"
    obj.modifiers.new("smooth", "SMOOTH")
    assert not is_edited_by_hand(obj), "places, names and modifiers are kept anyway"
    obj.data.vertices[7].co.z += 0.01
    assert is_edited_by_hand(obj)
    build_object(result, SHARED)
    assert not is_edited_by_hand(obj)
    obj.shape_key_add(name="Basis")
    assert is_edited_by_hand(obj)


@pytest.mark.parametrize(
    "edit",
    [
        lambda obj: obj.vertex_groups.new(name="pin").add([3], 1.0, "REPLACE"),
        lambda obj: setattr(obj.data.uv_layers[0].uv[5], "vector", (2, 3)),
        lambda obj: setattr(obj.data.uv_layers[0], "name", "mine"),
        lambda obj: obj.data.uv_layers.new(name="lightmap"),
        lambda obj: obj.data.color_attributes.new("paint", "FLOAT_COLOR", "POINT"),
        lambda obj: setattr(obj.data.polygons[4], "material_index", 1),
    ],
    ids=["weights", "uv", "uv name", "uv map", "color", "material"],
)
def test_what_an_update_would_discard_is_an_edit_by_hand(result: ResultArrays, edit: Any) -> None:
    """Weights, without which modifiers lose their vertex group, are as much work as a shape."""
    obj = build_object(result, SHARED).object
    edit(obj)
    assert is_edited_by_hand(obj)
    build_object(result, SHARED)
    assert not is_edited_by_hand(obj)


@pytest.mark.parametrize(
    "choose",
    [
        lambda mesh: mesh.shade_flat(),
        lambda mesh: mesh.shade_smooth(),
        lambda mesh: mesh.set_sharp_from_angle(angle=0.02),
        lambda mesh: mesh.attributes.remove(mesh.attributes["custom_normal"]),
    ],
    ids=["flat", "smooth", "by angle", "normals cleared"],
)
def test_the_shading_of_the_mesh_is_kept_and_no_edit(result: ResultArrays, choose: Any) -> None:
    """Shade Flat, and Clear Custom Split Normals, which shows it."""

    def shading(mesh: Any) -> tuple[Any, ...]:
        names = ("sharp_face", "sharp_edge")
        flags = [mesh.attributes.get(name) for name in names]
        sums = [None if flag is None else sum(one.value for one in flag.data) for flag in flags]
        return "custom_normal" in mesh.attributes, *sums

    obj = build_object(result, SHARED).object
    choose(obj.data)
    expected = shading(obj.data)
    for _ in range(2):
        assert not is_edited_by_hand(obj)
        build_object(result, SHARED)
        assert shading(obj.data) == expected


@pytest.mark.parametrize("name", ["sharp_face", "sharp_edge"])
def test_single_flat_faces_and_sharp_edges_are_edits(result: ResultArrays, name: str) -> None:
    mesh = build_object(result, SHARED).object.data
    domain = "FACE" if name == "sharp_face" else "EDGE"
    mesh.attributes.new(name, "BOOLEAN", domain).data[9].value = True
    assert is_edited_by_hand(bpy.data.objects["bump"])


def test_sculpted_levels_are_an_edit_by_hand(result: ResultArrays) -> None:
    obj = build_object(result, SHARED).object
    bpy.context.view_layer.objects.active = obj
    modifier = obj.modifiers.new("Multires", "MULTIRES")
    assert not is_edited_by_hand(obj), "nothing to sculpt on"
    bpy.ops.object.multires_subdivide(modifier=modifier.name)
    assert is_edited_by_hand(obj)


def test_a_mesh_of_an_earlier_version_is_known_by_its_shape(result: ResultArrays) -> None:
    obj = build_object(result, SHARED).object
    obj.data["isc_built_crc32"] = obj.data["isc_built_crc32"].split()[0]
    assert not is_edited_by_hand(obj)
    obj.data.vertices[7].co.z += 0.01
    assert is_edited_by_hand(obj)


def test_the_object_is_shown_in_the_largest_view(blender: Any, bump_folder: Path) -> None:
    blender.ops.wm.read_factory_settings(use_empty=False)
    view = find_view(blender.context.window, 0)
    assert view is not None and find_view(blender.context.window, view.as_pointer()) == view
    space = view.spaces.active
    space.shading.type = "SOLID"
    built = build_object(read_result(bump_folder), SHARED)
    show(blender.context, built, own_scene=False)
    assert space.shading.type == "MATERIAL"
    space.shading.type = "RENDERED"
    show(blender.context, built, own_scene=True, address=view.as_pointer())
    assert space.shading.type == "RENDERED" and space.region_3d.view_perspective == "CAMERA"


def test_a_view_turns_to_the_front_of_an_object() -> None:
    for turned in (0.0, 1.0, 4.0):
        rotation = Euler((0, 0, turned)).to_quaternion()
        front = rotation @ Vector((0, -1, 0))
        for view in (
            Euler((1.1, 0, 0.8 + turned)),
            Euler((0, 0, 0)),
            Euler((1.5, 0, 3.1 + turned)),
        ):
            toward_viewer = front_view(view.to_quaternion(), rotation) @ Vector((0, 0, 1))
            assert toward_viewer.angle(front) == pytest.approx(0.405, abs=0.02)
            assert toward_viewer.z > 0.15, "from above"
        kept = Euler((1.5, 0, turned + 0.2)).to_quaternion()
        assert front_view(kept, rotation) == kept


def test_two_objects_of_one_photo_share_the_material_of_the_original(
    result: ResultArrays,
) -> None:
    built = build_object(result, SHARED)
    bpy.context.view_layer.objects.active = built.object
    built.object.select_set(True)
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    place = copy.location.copy()
    build_object(result, SHARED)
    found = find_built(copy)
    assert found is not None and found.material == built.material and copy.location == place
