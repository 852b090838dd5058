"""An object as an asset: its file, catalog and preview; libraries that cannot be used."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.materials.edit_nodes import surface_node  # noqa: E402 (after the skip)
from blender_addon.operators.asset import library_folder  # noqa: E402
from blender_addon.scene import asset  # noqa: E402
from blender_addon.scene.asset import CATALOG  # noqa: E402
from blender_addon.scene.built_object import BuiltObject, find_built  # noqa: E402
from isc_core.errors import InputError  # noqa: E402


@pytest.fixture
def built(addon: Any, bump_folder: Path) -> BuiltObject:
    """The bump, active in the user's scene."""
    addon.ops.isc.import_result(directory=str(bump_folder))
    found = find_built(addon.context.object)
    assert found is not None
    return found


def add_library(addon: Any, folder: Path) -> str:
    addon.ops.preferences.asset_library_add(directory=str(folder))
    name: str = addon.context.preferences.filepaths.asset_libraries[-1].name
    return name


def pixels_of(preview: Any) -> np.ndarray:
    values = np.empty(len(preview.image_pixels_float), np.float32)
    preview.image_pixels_float.foreach_get(values)
    return values.reshape(preview.image_size[1], preview.image_size[0], 4)


@pytest.mark.slow
def test_an_asset_can_be_appended_elsewhere(addon: Any, built: BuiltObject, tmp_path: Path) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "blender_assets.cats.txt").write_text("VERSION 1\n\nabc:Mine:Mine")
    name = add_library(addon, tmp_path / "assets")
    blocks = {kind: len(getattr(addon.data, kind)) for kind in ("scenes", "cameras", "images")}
    for _ in range(2):
        assert addon.ops.isc.save_asset(library=name) == {"FINISHED"}
    assert {kind: len(getattr(addon.data, kind)) for kind in blocks} == blocks
    files = sorted(path.name for path in (tmp_path / "assets").iterdir())
    assert files == ["blender_assets.cats.txt", "bump-2.blend", "bump.blend"]
    catalogs = (tmp_path / "assets" / files[0]).read_text().splitlines()
    assert catalogs[2] == "abc:Mine:Mine" and len(catalogs) == 5
    assert catalogs[3].endswith(":ISC:ISC"), "a parent that is missing is an unsaved change"
    assert catalogs[4] == f"{CATALOG}:ISC/Photo Objects:ISC-Photo Objects"
    picture = pixels_of(built.object.preview)
    alpha = picture[..., 3]
    assert 0.3 < (alpha > 0.5).mean() < 0.9 and alpha[0, 0] == 0, "the object alone"
    red, blue = (
        picture[half][alpha[half] > 0.9].mean(0) for half in (slice(140, 256), slice(0, 116))
    )
    assert red[0] > red[2] and blue[2] > blue[0], "upright, red above and blue below"
    addon.ops.wm.read_factory_settings(use_empty=True)
    with addon.data.libraries.load(str(tmp_path / "assets" / "bump.blend"), assets_only=True) as (
        present,
        wanted,
    ):
        assert present.objects == ["bump"] and len(present.materials) == 1
        wanted.objects = ["bump"]
    (obj,) = wanted.objects
    assert obj.asset_data.catalog_id == CATALOG and "ISC" in obj.asset_data.tags
    images = [value for value in obj.values() if isinstance(value, bpy.types.Image)]
    assert images and all(image.packed_file is not None for image in images)


def test_assets_of_similar_names_do_not_replace_each_other(
    addon: Any, built: BuiltObject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(asset, "_set_preview", lambda built: None)
    names = ["cup 1", "cup.1", "cup_1", "caf\u00e9", "caf\u00e8", "\u676f"]
    for name in names:
        built.object.name = name
        asset.save_asset(built, tmp_path, overwrite=True)
    assert {path.stem for path in tmp_path.glob("*.blend")} == set(names)


def test_an_asset_is_saved_without_cycles(addon: Any, built: BuiltObject, tmp_path: Path) -> None:
    import addon_utils  # type: ignore[import-not-found]

    name = add_library(addon, tmp_path)
    addon_utils.disable("cycles")
    try:
        assert addon.ops.isc.save_asset(library=name) == {"FINISHED"}
    finally:
        addon_utils.enable("cycles")
    assert (tmp_path / "bump.blend").is_file() and built.object.asset_data is not None


def test_an_asset_has_what_was_painted(
    addon: Any, built: BuiltObject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(asset, "_set_preview", lambda _: None)
    tree, surface = built.material.node_tree, surface_node(built.material)
    assert surface is not None
    roughness = addon.data.images.new("roughness", 4, 4)
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = roughness
    tree.links.new(node.outputs["Color"], surface.inputs["Roughness"])
    for image in (roughness, tree.nodes["Base Color"].image):
        image.pixels.foreach_set(np.tile(np.float32([0, 1, 0, 1]), len(image.pixels) // 4))
        image.update()
        assert image.is_dirty
    path = asset.save_asset(built, tmp_path)
    addon.ops.wm.read_factory_settings(use_empty=True)
    with addon.data.libraries.load(str(path)) as (_, wanted):
        wanted.objects = ["bump"]
    for name in ("roughness", "bump_basecolor"):
        image = addon.data.images[name]
        assert image.packed_file is not None
        assert tuple(image.pixels[:4]) == pytest.approx((0, 1, 0, 1), abs=0.01), name


def test_an_asset_has_the_users_material(
    addon: Any, built: BuiltObject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(asset, "_set_preview", lambda _: None)
    built.object.material_slots[0].material = addon.data.materials.new("Gold")
    path = asset.save_asset(built, tmp_path)
    assert built.object.asset_data is not None and built.material.asset_data is None
    addon.ops.wm.read_factory_settings(use_empty=True)
    with addon.data.libraries.load(str(path)) as (_, wanted):
        wanted.objects = ["bump"]
    (obj,) = wanted.objects
    assert obj.material_slots[0].material.name == "Gold" and find_built(obj) is not None


def test_a_library_that_cannot_be_written_is_reported(
    addon: Any, built: BuiltObject, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in place of a folder")
    name = add_library(addon, tmp_path / "file")
    with pytest.raises(RuntimeError, match="cannot be written to: choose another") as caught:
        addon.ops.isc.save_asset(library=name)
    assert len(str(caught.value).strip().splitlines()) == 1
    assert built.object.asset_data is None and built.material.asset_data is None


def test_a_missing_library_is_reported(addon: Any, built: BuiltObject) -> None:
    with pytest.raises(InputError, match="add one in Preferences"):
        library_folder(addon.context, "nowhere")


def test_a_linked_object_says_what_to_do(addon: Any, tmp_path: Path, built: BuiltObject) -> None:
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    addon.ops.wm.read_factory_settings(use_empty=True)
    with addon.data.libraries.load(str(tmp_path / "a.blend"), link=True) as (_, wanted):
        wanted.objects = ["bump"]
    addon.context.scene.collection.objects.link(wanted.objects[0])
    addon.context.view_layer.objects.active = wanted.objects[0]
    with pytest.raises(RuntimeError, match="linked from another file: make it local"):
        addon.ops.isc.save_asset()
