"""Export by Blender's own exporters: what is read back is the object, edits included."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from benchmarks.blender.read_back import READERS, read_back, shown  # noqa: E402
from blender_addon.files.result_arrays import read_result  # noqa: E402
from blender_addon.materials.edit_nodes import dichromatic_node, surface_node  # noqa: E402
from blender_addon.materials.material import shows_highlights  # noqa: E402
from blender_addon.operators.export import export_object  # noqa: E402
from blender_addon.scene.build import build_object  # noqa: E402
from blender_addon.scene.built_object import BuiltObject  # noqa: E402
from blender_addon.scene.preparation import BuildOptions  # noqa: E402
from isc_core.errors import InputError  # noqa: E402
from isc_core.evaluation.metrics import psnr  # noqa: E402

EDITS = {
    "unedited": {},
    "edited": {"Hue": 0.7, "Value": 0.8, "Specular Gain": 2.0, "Gloss Gain": 1.5},
}


@pytest.fixture
def enabled(blender: Any) -> Iterator[Any]:
    """Blender with the add-on enabled in its preferences, so that exporters ask it."""
    import addon_utils  # type: ignore[import-not-found]

    addon_utils.enable("blender_addon", default_set=True)
    yield blender
    addon_utils.disable("blender_addon", default_set=True)


@pytest.fixture
def built(enabled: Any, bump_folder: Path) -> BuiltObject:
    """The bump, glossy."""
    result = replace(read_result(bump_folder), specular_level=0.8, roughness=0.35)
    options = BuildOptions(own_scene=False, set_camera=True, set_world=True, set_resolution=True)
    made = build_object(result, options)
    made.object.select_set(True)
    bpy.context.view_layer.objects.active = made.object
    return made


def edit(built: BuiltObject, values: dict[str, float]) -> None:
    node = dichromatic_node(built.material)
    assert node is not None
    for name, value in values.items():
        node.inputs[name].default_value = value


def standard_export(kind: str, path: Path) -> None:
    """What File > Export calls."""
    if kind == "GLB":
        bpy.ops.export_scene.gltf(filepath=str(path), use_selection=True)
    elif kind == "USD":
        bpy.ops.wm.usd_export(filepath=str(path), selected_objects_only=True)
    elif kind == "FBX":
        bpy.ops.export_scene.fbx(
            filepath=str(path), use_selection=True, path_mode="COPY", embed_textures=True
        )


@pytest.mark.slow
@pytest.mark.parametrize("edits", EDITS)
@pytest.mark.parametrize("kind", ["GLB", "USD", "FBX", "OBJ"])
def test_the_exported_object_looks_as_in_the_scene(
    built: BuiltObject, tmp_path: Path, kind: str, edits: str
) -> None:
    edit(built, EDITS[edits])
    names = export_object(built, tmp_path, kind)
    wanted, mask = shown(built, 16)
    found, _ = read_back(built, tmp_path / "bump" / names[0], 16)
    assert psnr(wanted, found, mask, peak=float(wanted[mask].max())) > 30


@pytest.mark.slow
@pytest.mark.parametrize("edits", EDITS)
@pytest.mark.parametrize("kind", ["GLB", "USD", "FBX"])
def test_blenders_own_exporters_give_the_edited_object(
    built: BuiltObject, tmp_path: Path, kind: str, edits: str
) -> None:
    """Without a call of ours: a slider has moved, then File > Export."""
    edit(built, EDITS[edits])
    path = tmp_path / f"object.{READERS[kind][0]}"
    standard_export(kind, path)
    wanted, mask = shown(built, 16)
    found, _ = read_back(built, path, 16)
    assert psnr(wanted, found, mask, peak=float(wanted[mask].max())) > 30


VALIDATE = """
const {validateBytes} = require("gltf-validator"), {readFileSync} = require("fs");
validateBytes(new Uint8Array(readFileSync(process.argv[1]))).then(
    report => console.log(JSON.stringify(report.issues)));
"""


@pytest.mark.parametrize("edits", EDITS)
def test_the_validator_of_gltf_finds_no_error(
    built: BuiltObject, tmp_path: Path, edits: str
) -> None:
    """Khronos's own program, where Node.js finds it (`npm install gltf-validator`, NODE_PATH)."""
    node = shutil.which("node")
    if (
        node is None
        or subprocess.run(
            [node, "-e", "require('gltf-validator')"], capture_output=True, check=False
        ).returncode
    ):
        pytest.skip("needs Node.js with gltf-validator")
    edit(built, EDITS[edits])
    standard_export("GLB", tmp_path / "a.glb")
    done = subprocess.run(
        [node, "-e", VALIDATE, tmp_path / "a.glb"], capture_output=True, check=True, text=True
    )
    issues = json.loads(done.stdout)
    assert issues["numErrors"] == 0, issues["messages"]
    # Tangents are left to the reader; textures are of any size.
    expected = {"MESH_PRIMITIVE_GENERATED_TANGENT_SPACE", "IMAGE_NPOT_DIMENSIONS"}
    assert {message["code"] for message in issues["messages"]} <= expected


def test_the_layer_of_highlights_is_not_exported_as_light(
    enabled: Any, bump_folder: Path, tmp_path: Path
) -> None:
    import trimesh

    result = replace(read_result(bump_folder), specular_level=0.8, roughness=0.35)
    made = build_object(result, BuildOptions(own_scene=False, specular_from="image"))
    made.object.select_set(True)
    standard_export("GLB", tmp_path / "a.glb")
    material = trimesh.load(tmp_path / "a.glb", force="mesh").visual.material
    assert material.emissiveTexture is None and material.emissiveFactor is None
    assert material.baseColorTexture.size == made.object["isc_map_mask"].size[:]
    assert shows_highlights(made.material), "it is there again"


def test_usd_has_a_preview_surface_with_the_index_of_the_level(
    built: BuiltObject, tmp_path: Path
) -> None:
    pxr = pytest.importorskip("pxr", reason="needs the extra `usd`")
    from pxr import Usd, UsdShade

    assert pxr
    standard_export("USD", tmp_path / "a.usda")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    (shader,) = (
        UsdShade.Shader(prim)
        for prim in stage.Traverse()
        if UsdShade.Shader(prim) and UsdShade.Shader(prim).GetShaderId() == "UsdPreviewSurface"
    )
    amplitude = (0.04 * 0.8) ** 0.5
    assert shader.GetInput("ior").Get() == pytest.approx((1 + amplitude) / (1 - amplitude))
    assert shader.GetInput("roughness").Get() == pytest.approx(0.35)
    assert shader.GetInput("diffuseColor").HasConnectedSource()


@pytest.mark.parametrize("kind", ["GLB", "USD", "FBX", "OBJ"])
def test_a_linked_object_is_exported_as_an_override(
    built: BuiltObject, tmp_path: Path, kind: str
) -> None:
    """Linked, it has to be made local, which the button says."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "a.blend"), link=True) as (_, wanted):
        wanted.objects = ["bump"]
    (linked,) = wanted.objects
    bpy.context.scene.collection.objects.link(linked)
    bpy.context.view_layer.objects.active = linked
    with pytest.raises(RuntimeError, match=r"linked from another file: make it local first"):
        bpy.ops.isc.export(directory=str(tmp_path))
    override = linked.override_create(remap_local_usages=True)
    bpy.context.view_layer.objects.active = override
    override.select_set(True)
    assert bpy.ops.isc.export(directory=str(tmp_path), file_format=kind) == {"FINISHED"}
    assert (tmp_path / "bump" / f"bump.{READERS[kind][0]}").stat().st_size > 1000


def test_obj_comes_with_its_textures(built: BuiltObject, tmp_path: Path) -> None:
    export_object(built, tmp_path, "OBJ")
    text = (tmp_path / "bump" / "bump.mtl").read_text()
    assert "map_Kd bump_basecolor.png" in text and "Pr 0.35" in text
    assert (tmp_path / "bump" / "bump_basecolor.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("kind", ["OBJ", "USD", "FBX"])
def test_what_was_painted_is_exported(built: BuiltObject, tmp_path: Path, kind: str) -> None:
    image = built.material.node_tree.nodes["Base Color"].image
    image.pixels.foreach_set(np.tile(np.float32([0, 1, 0, 1]), len(image.pixels) // 4))
    image.update()
    assert image.is_dirty
    export_object(built, tmp_path, kind)
    if kind == "FBX":
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.import_scene.fbx(filepath=str(tmp_path / "bump" / "bump.fbx"))
        found = next(image for image in bpy.data.images if "basecolor" in image.name)
    else:
        (path,) = (tmp_path / "bump").rglob("*basecolor.png")
        found = bpy.data.images.load(str(path))
    assert tuple(found.pixels[:4]) == pytest.approx((0, 1, 0, 1), abs=0.01)


@pytest.mark.parametrize("file_format", ["PNG8", "PNG16", "EXR"])
def test_texture_sets_have_the_edits(built: BuiltObject, tmp_path: Path, file_format: str) -> None:
    from isc_core.io.decoders import read_raster
    from isc_core.io.exr import read_channels

    edit(built, {"Saturation": 0.0, "Gloss Gain": 2.0})
    assert bpy.ops.isc.export_textures(directory=str(tmp_path), file_format=file_format) == {
        "FINISHED"
    }
    suffix = "exr" if file_format == "EXR" else "png"
    names = {path.name for path in (tmp_path / "bump").iterdir()}
    wanted = ("basecolor", "normal", "roughness", "specular", "height", "ao")
    assert names == {f"bump_{one}.{suffix}" for one in wanted}

    def values(name: str) -> np.ndarray:
        path = tmp_path / "bump" / f"bump_{name}.{suffix}"
        if suffix == "exr":
            channels = read_channels(path)
            return np.stack([channels[letter] for letter in "RGB"], -1)
        codes = read_raster(path).values
        assert codes.dtype == (np.uint16 if file_format == "PNG16" else np.uint8)
        return codes.reshape(*codes.shape[:2], -1) / np.iinfo(codes.dtype).max

    paint = values("basecolor")[20, 38, :3]
    assert np.ptp(paint) < 0.01 and paint[0] > 0.05, "gray, as edited"
    assert values("roughness")[0, 0, 0] == pytest.approx(0.175, abs=0.003)
    assert values("specular")[0, 0, 0] == pytest.approx(0.4, abs=0.003)
    height = values("height")[..., 0]
    assert height[27, 38] > 0.99 and height[0, 0] == 0


def test_texture_sets_have_one_size(enabled: Any, bump_folder: Path, tmp_path: Path) -> None:
    """That of the base colour; the normals between pixels of the maps are unit vectors."""
    from isc_core.io.decoders import read_raster

    result = read_result(bump_folder)
    height, width = result.mask.shape
    tilt = np.linspace(-0.5, 0.5, width)[None, :].repeat(height, 0)
    normals = np.dstack([np.sin(tilt), 0 * tilt, np.cos(tilt)])
    fine = replace(
        result,
        normal_map=((normals + 1) / 2).astype(np.float32),
        texture=np.full((4 * height, 4 * width, 3), 128, np.uint8),
        specular_variation=np.where(result.mask, 0.5, 1.0).astype(np.float32),
    )
    build_object(fine, BuildOptions(own_scene=False))
    bpy.context.view_layer.objects.active = bpy.data.objects["bump"]
    assert bpy.ops.isc.export_textures(directory=str(tmp_path)) == {"FINISHED"}
    files = {path.stem[5:]: read_raster(path).values for path in tmp_path.glob("bump/*.png")}
    assert {values.shape[:2] for values in files.values()} == {(4 * height, 4 * width)}
    inside = np.kron(result.mask, np.ones((4, 4), bool))
    deep = np.kron(ndimage.binary_erosion(result.mask, iterations=3), np.ones((4, 4), bool))
    level = files["specular"][inside].astype(int)
    assert np.ptp(level) <= 1, "the factor beyond the object does not change that of its rim"
    place = ((np.arange(4 * width) + 0.5) / 4 - 0.5) / (width - 1) - 0.5
    expected = np.stack([np.sin(place), 0 * place, np.cos(place)], -1)
    found = files["normal"] / 127.5 - 1
    assert np.abs(found - expected)[deep].max() < 0.012


def test_a_painted_roughness_is_exported(built: BuiltObject, tmp_path: Path) -> None:
    from isc_core.io.decoders import read_raster

    tree, surface = built.material.node_tree, surface_node(built.material)
    assert surface is not None
    painted = bpy.data.images.new("painted", 2, 1)
    painted.colorspace_settings.name = "Non-Color"
    painted.pixels.foreach_set(np.float32([0.2, 0.2, 0.2, 1, 0.8, 0.8, 0.8, 1]))
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = painted
    tree.links.new(node.outputs["Color"], surface.inputs["Roughness"])
    bpy.ops.isc.export_textures(directory=str(tmp_path))
    found = read_raster(tmp_path / "bump" / "bump_roughness.png").values / 255
    size = read_raster(tmp_path / "bump" / "bump_basecolor.png").values.shape[:2]
    assert found.shape[:2] == size
    left, right = found[0, 0].item(), found[0, -1].item()
    assert (left, right) == pytest.approx((0.2, 0.8), abs=0.05)


def test_packed_textures_have_each_value_in_its_channel(built: BuiltObject, tmp_path: Path) -> None:
    from PIL import Image

    def codes(name: str) -> np.ndarray:
        return np.asarray(Image.open(tmp_path / "bump" / f"bump_{name}.png"))

    bpy.ops.isc.export_textures(directory=str(tmp_path), program="unreal")
    orm = codes("orm")
    assert orm[0, 0, 1] == round(255 * 0.35) and orm[0, 0, 2] == 0 and orm[0, 0, 0] == 255
    bpy.ops.isc.export_textures(directory=str(tmp_path), program="unity")
    assert codes("mask_map")[0, 0, 3] == codes("metallic_smoothness")[0, 0, 3] == 166


def test_the_direction_of_green_is_the_programs_or_the_chosen(
    enabled: Any, bump_folder: Path, tmp_path: Path
) -> None:
    from isc_core.io.decoders import read_raster

    result = read_result(bump_folder)
    tilted = result.normal_map.copy()
    tilted[..., 1] = 0.75
    build_object(replace(result, normal_map=tilted), BuildOptions(own_scene=False))
    bpy.context.view_layer.objects.active = bpy.data.objects["bump"]
    for program, normals, green in (
        ("generic", "TARGET", 191),
        ("unreal", "TARGET", 64),
        ("unreal", "OPENGL", 191),
        ("generic", "DIRECTX", 64),
    ):
        bpy.ops.isc.export_textures(directory=str(tmp_path), program=program, normals=normals)
        codes = read_raster(tmp_path / "bump" / "bump_normal.png").values
        assert abs(int(codes[5, 5, 1]) - green) <= 1, (program, normals)


def test_a_hidden_object_is_not_exported_as_an_empty_file(
    built: BuiltObject, tmp_path: Path
) -> None:
    built.object.hide_set(True)
    with pytest.raises(InputError, match="bump is hidden"):
        export_object(built, tmp_path)
    built.object.hide_set(False)
    other = bpy.data.scenes.new("other")
    with (
        bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]),
        pytest.raises(InputError, match="bump is not in this view layer"),
    ):
        export_object(built, tmp_path)
    assert not list((tmp_path / "bump").iterdir())


def test_an_export_leaves_the_selection(built: BuiltObject, tmp_path: Path) -> None:
    cube = bpy.data.objects.new("cube", bpy.data.meshes.new("cube"))
    built.scene.collection.objects.link(cube)
    cube.select_set(True)
    for selected in (False, True):
        built.object.select_set(selected)
        export_object(built, tmp_path)
        assert (cube.select_get(), built.object.select_get()) == (True, selected)


def test_paths_of_textures_are_restored_if_one_cannot_be_written(
    built: BuiltObject, tmp_path: Path
) -> None:
    images = [node.image for node in built.material.node_tree.nodes if node.type == "TEX_IMAGE"]
    before = [image.filepath_raw for image in images]
    (tmp_path / "bump" / "mine.png").mkdir(parents=True)
    for image in images[1:]:
        image.name = "mine"
    extra = built.material.node_tree.nodes.new("ShaderNodeTexImage")
    extra.image = images[0].copy()
    extra.image.name = "mine"
    with pytest.raises(InputError, match="cannot write to"):
        export_object(built, tmp_path, "OBJ")
    assert [image.filepath_raw for image in images] == before
    assert extra.image.filepath_raw == before[0]


def test_a_material_whose_surface_was_renamed_is_exported(
    built: BuiltObject, tmp_path: Path
) -> None:
    import trimesh

    edit(built, {"Gloss Gain": 0.5})
    surface = surface_node(built.material)
    assert surface is not None
    surface.name = "mine"
    export_object(built, tmp_path)
    material = trimesh.load(tmp_path / "bump" / "bump.glb", force="mesh").visual.material
    assert material.baseColorTexture.size == built.object["isc_map_mask"].size[:]
    assert material.roughnessFactor == pytest.approx(0.7)
