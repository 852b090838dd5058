"""The fine base colour as Blender's texture: the same colours in more pixels, on the same UVs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb


def build(result: ResultArrays, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options))


def texture(built: Any, name: str = "Base Color") -> Any:
    return built.material.node_tree.nodes[name].image


def codes(image: Any) -> np.ndarray:
    """(H, W, 3) in 0..255, row 0 at the top."""
    width, height = image.size
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    return np.rint(255 * values.reshape(height, width, 4)[::-1, :, :3]).astype(int)


@pytest.fixture
def fine(bump_folder: Path) -> ResultArrays:
    """Its texture has three times the resolution of the maps, and stripes that the maps lack."""
    result = read_result(bump_folder)
    color = result.base_color.repeat(3, 0).repeat(3, 1)
    color[::2] *= 0.5
    values = np.rint(255 * linear_to_srgb(np.clip(color, 0, 1))).astype(np.uint8)
    return replace(result, texture=values)


def test_the_material_shows_the_fine_texture(blender: Any, fine: ResultArrays) -> None:
    image = texture(build(fine, specular_from="none"))
    assert tuple(image.size) == (3 * fine.size[0], 3 * fine.size[1])
    assert image.packed_file is not None and image.colorspace_settings.name == "sRGB"
    assert fine.texture is not None and np.array_equal(codes(image), fine.texture)


def test_the_photos_highlights_are_on_the_plain_texture(blender: Any, fine: ResultArrays) -> None:
    """The surface's own highlights, and its environment's, are on another one."""
    from blender_addon.materials.edit_nodes import dichromatic_node
    from blender_addon.materials.material_edits import bake_edits
    from blender_addon.materials.photo_highlights import hide_highlights, show_highlights

    glossy = replace(fine, specular_level=1.0, roughness=0.3)
    built = build(glossy, specular_from="image")
    assert fine.texture is not None and np.array_equal(codes(texture(built)), fine.texture)
    hide_highlights(built.material)
    bake_edits(built.material)
    under = codes(texture(built))
    bright = fine.texture > 40
    assert (under != fine.texture)[bright].mean() > 0.5
    show_highlights(built.material)
    bake_edits(built.material)
    assert np.array_equal(codes(texture(built)), fine.texture)
    node = dichromatic_node(build(glossy, specular_from="lobe").material)
    assert node is not None
    assert np.array_equal(codes(texture(built)), under)
    node.inputs["Specular Gain"].default_value = 0.0
    bake_edits(built.material)
    assert np.array_equal(codes(texture(built)), fine.texture), "a diffuse surface is the photo's"
    node.inputs["Specular Gain"].default_value = 1.0

    mine = blender.data.images.new("mine", 4, 4)
    built.material.node_tree.nodes["Base Color"].image = mine
    bake_edits(built.material)
    assert texture(built) == mine, "the user's own image stays"


def test_a_build_without_gloss_leaves_one_texture(blender: Any, fine: ResultArrays) -> None:
    def roles() -> list[str]:
        return [role for image in blender.data.images if "base" in (role := image["isc_role"])]

    build(replace(fine, specular_level=1.0, roughness=0.3), specular_from="image")
    assert sorted(roles()) == ["base_color", "plain_base_color"]
    built = build(fine)
    assert roles() == ["base_color"]
    assert np.array_equal(codes(texture(built)), fine.texture)


def test_building_again_with_maps_replaces_it(blender: Any, fine: ResultArrays) -> None:
    build(fine)
    image = texture(build(replace(fine, texture=None)))
    assert tuple(image.size) == fine.size


def test_hue_is_edited_at_full_resolution(blender: Any, fine: ResultArrays) -> None:
    from blender_addon.materials.edit_nodes import dichromatic_node
    from blender_addon.materials.material_edits import bake_edits

    built = build(fine, specular_from="lobe")
    node = dichromatic_node(built.material)
    assert node is not None
    node.inputs["Hue"].default_value = 0.8
    bake_edits(built.material)
    assert tuple(texture(built, "Edited Base Color").size) == tuple(texture(built).size)


def test_a_texture_of_another_kind_is_refused(bump_folder: Path, tmp_path: Path) -> None:
    arrays = dict(np.load(bump_folder / "arrays.npz"))
    folder = tmp_path / "bump"
    folder.mkdir()
    (folder / "decomposition.json").write_bytes((bump_folder / "decomposition.json").read_bytes())
    for wrong in (np.zeros((4, 4, 3), np.float32), np.zeros((4, 4), np.uint8)):
        np.savez(folder / "arrays.npz", **{**arrays, "texture": wrong})
        with pytest.raises(InputError, match="texture"):
            read_result(folder)
