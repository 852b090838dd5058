"""Meshes in other formats, read back by other programs: the same places and pictures."""

import errno
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.lobe_fitting.specular_level import SpecularFit, SpecularSource
from isc_core.result_files.exports.mesh_file import write_mesh_file
from isc_core.result_files.mesh.build import build_mesh
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.mesh.result import MeshResult
from tests.core.ball_scene import ball

FITTED = SpecularSource.FITTED


def glossy(variation: np.ndarray | None = None, triangles: int = 3000) -> MeshResult:
    d = ball()
    gloss = SpecularFit(0.3, 0.5, FITTED, FITTED, variation)
    options = MeshOptions(triangles=triangles)
    return replace(build_mesh(d.height, d.normal, d.mask, d.reflectance, options), gloss=gloss)


def varying() -> np.ndarray:
    return np.where(np.indices(ball().mask.shape)[1] > 60, 1.0, 0.5)


def codes(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


def check_textures(built: MeshResult, folder: Path, name: str) -> None:
    color = codes(folder / f"{name}_basecolor.png")
    linear = srgb_to_linear(color / 255)
    assert np.abs(linear - np.clip(built.base_color, 0, 1)).max() < 0.005
    local = codes(folder / f"{name}_mesh_normal.png") / 127.5 - 1
    assert np.abs(local - built.detail).max() < 0.005


def test_obj_is_read_back(tmp_path: Path) -> None:
    built = glossy()
    files = write_mesh_file(built, tmp_path / "my ball.obj", "obj")
    names = ["my ball.obj", "my_ball.mtl", "my_ball_basecolor.png", "my_ball_mesh_normal.png"]
    assert [path.name for path in files] == names
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    mesh = trimesh.load(files[0], process=False, maintain_order=True)
    np.testing.assert_allclose(mesh.vertices, built.mesh.vertices, atol=1e-7)
    np.testing.assert_allclose(mesh.visual.uv, built.mesh.uv, atol=1e-6)
    np.testing.assert_allclose(mesh.vertex_normals, built.mesh.vertex_normals, atol=1e-5)
    assert (mesh.faces == built.mesh.faces).all()
    assert mesh.visual.material.image.size == (120, 96)
    check_textures(built, tmp_path, "my_ball")
    material = (tmp_path / "my_ball.mtl").read_text().splitlines()
    assert {"Pr 0.3", "Pm 0", "Ns 490", "norm my_ball_mesh_normal.png"} <= set(material)
    level = next(float(line.split()[1]) for line in material if line.startswith("Ks"))
    assert level == pytest.approx(0.5 * built.specular, rel=1e-5)


def test_blender_reads_the_material_of_an_obj(tmp_path: Path) -> None:
    bpy = pytest.importorskip("bpy", reason="needs the bpy module (extra `blender`)")
    built = glossy()
    write_mesh_file(built, tmp_path / "ball.obj", "obj")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.ops.wm.obj_import(filepath=str(tmp_path / "ball.obj")) == {"FINISHED"}
    material = bpy.data.objects[0].data.materials[0]
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    assert shader.inputs["Roughness"].default_value == pytest.approx(0.3, abs=1e-3)
    assert shader.inputs["Base Color"].is_linked
    assert shader.inputs["Normal"].is_linked
    level = shader.inputs["Specular IOR Level"].default_value
    assert level == pytest.approx(0.5 * built.specular, rel=1e-3)


def test_a_full_grid_needs_no_normal_map_and_the_same_mesh_gives_the_same_bytes(
    tmp_path: Path,
) -> None:
    built = glossy(triangles=0)
    files = write_mesh_file(built, tmp_path / "a" / "ball.obj", "obj")
    again = write_mesh_file(built, tmp_path / "b" / "ball.obj", "obj")
    assert [path.name for path in files] == ["ball.obj", "ball.mtl", "ball_basecolor.png"]
    assert [path.read_bytes() for path in files] == [path.read_bytes() for path in again]


def test_glb_is_that_of_the_result(tmp_path: Path) -> None:
    built = glossy()
    assert write_mesh_file(built, tmp_path / "ball.glb", "glb") == [tmp_path / "ball.glb"]
    assert (tmp_path / "ball.glb").read_bytes() == built.glb()


def stage_of(path: Path) -> Any:
    return pytest.importorskip("pxr.Usd", reason="needs usd-core (extra `usd`)").Stage.Open(
        str(path)
    )


@pytest.fixture(params=[".usda", ".usdc", ".usdz"])
def written(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[MeshResult, Path]:
    pytest.importorskip("pxr.Usd", reason="needs usd-core (extra `usd`)")
    built, path = glossy(), tmp_path / f"2 balls{request.param}"
    files = write_mesh_file(built, path, "usd")
    assert files[0] == path
    beside = [] if request.param == ".usdz" else ["basecolor", "mesh_normal"]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        [path.name, *(f"2_balls_{name}.png" for name in beside)]
    )
    return built, path


def test_usd_is_read_back(written: tuple[MeshResult, Path]) -> None:
    built, path = written
    from pxr import UsdGeom

    stage = stage_of(path)
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    root = stage.GetDefaultPrim()
    assert str(root.GetPath()) == "/_2_balls"
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(root.GetPath().AppendChild("mesh")))
    np.testing.assert_allclose(mesh.GetPointsAttr().Get(), built.mesh.vertices, atol=1e-8)
    np.testing.assert_allclose(mesh.GetNormalsAttr().Get(), built.mesh.vertex_normals, atol=1e-6)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    assert (indices == built.mesh.faces).all()
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
    uv = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get()
    np.testing.assert_allclose(uv, built.mesh.uv, atol=1e-7)
    extent = np.array(mesh.GetExtentAttr().Get())
    np.testing.assert_allclose(extent[1], built.mesh.vertices.max(0), atol=1e-8)


def test_the_material_of_usd_is_complete(written: tuple[MeshResult, Path]) -> None:
    built, path = written
    from pxr import UsdShade, UsdUtils

    stage = stage_of(path)
    mesh = next(prim for prim in stage.Traverse() if prim.GetName() == "mesh")
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    surface, _, _ = material.ComputeSurfaceSource()
    assert surface.GetIdAttr().Get() == "UsdPreviewSurface"
    assert surface.GetInput("roughness").Get() == pytest.approx(0.3)
    ior = surface.GetInput("ior").Get()
    assert ((ior - 1) / (ior + 1)) ** 2 == pytest.approx(0.04 * built.specular, rel=1e-4)
    layers, assets, missing = UsdUtils.ComputeAllDependencies(str(path))
    assert len(layers) == 1 and len(assets) == 2 and not missing
    for name, space in (("diffuseColor", "sRGB"), ("normal", "raw")):
        reader = UsdShade.Shader(
            surface.GetInput(name).GetConnectedSources()[0][0].source.GetPrim()
        )
        assert reader.GetInput("sourceColorSpace").Get() == space
    if path.suffix != ".usdz":
        check_textures(built, path.parent, "2_balls")


def test_names_in_an_archive_are_ascii(tmp_path: Path) -> None:
    pytest.importorskip("pxr.Usd", reason="needs usd-core (extra `usd`)")
    from pxr import UsdUtils

    path = tmp_path / "Töpfe.usdz"
    write_mesh_file(glossy(), path, "usd")
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist()[0].endswith(".usdc") and len(archive.namelist()) == 3
        assert all(name.isascii() for name in archive.namelist())
    _, assets, missing = UsdUtils.ComputeAllDependencies(str(path))
    assert len(assets) == 2 and not missing


def test_a_level_that_varies_is_a_texture_of_usd_and_obj(tmp_path: Path) -> None:
    pytest.importorskip("pxr.Usd", reason="needs usd-core (extra `usd`)")
    from pxr import UsdShade

    built = glossy(varying())
    write_mesh_file(built, tmp_path / "ball.usdc", "usd")
    stage = stage_of(tmp_path / "ball.usdc")
    surface = UsdShade.Shader(stage.GetPrimAtPath("/ball/material/surface"))
    assert not surface.GetInput("useSpecularWorkflow")
    reader = UsdShade.Shader(surface.GetInput("ior").GetConnectedSources()[0][0].source.GetPrim())
    scale, bias = (reader.GetInput(name).Get()[0] for name in ("scale", "bias"))
    index = scale * codes(tmp_path / "ball_ior.png") / 255 + bias
    level = built.specular * varying()
    assert np.abs(((index - 1) / (index + 1)) ** 2 - 0.04 * level).max() < 0.001
    write_mesh_file(built, tmp_path / "ball.obj", "obj")
    assert "Ks 1 1 1\n" in (tmp_path / "ball.mtl").read_text()
    assert np.abs(obj_reflectance(tmp_path / "ball.mtl") - 0.04 * level).max() < 0.001


def obj_reflectance(library: Path) -> np.ndarray:
    """The reflectance along the normal that Blender takes from a material library."""
    lines = (line.split() for line in library.read_text().splitlines())
    values = {words[0]: words[-1] for words in lines if words}
    strength = np.asarray(float(values["Ks"]))
    if "map_Ks" in values:
        strength = srgb_to_linear(codes(library.parent / values["map_Ks"]) / 255)
    index = float(values["Ni"])
    return 2 * strength * ((index - 1) / (index + 1)) ** 2


@pytest.mark.parametrize("variation", [None, varying()])
def test_a_level_above_the_range_of_an_obj_raises_the_index(
    tmp_path: Path, variation: np.ndarray | None
) -> None:
    built = glossy(variation)
    high = replace(built.gloss, specular=3.0 / built.reflectance_scale)
    write_mesh_file(replace(built, gloss=high), tmp_path / "ball.obj", "obj")
    wanted = 0.12 * (1.0 if variation is None else variation)
    assert np.abs(obj_reflectance(tmp_path / "ball.mtl") - wanted).max() < 0.001


@pytest.mark.parametrize("suffix", ["obj", "usdc"])
def test_blender_reads_a_level_that_varies(tmp_path: Path, suffix: str) -> None:
    bpy = pytest.importorskip("bpy", reason="needs the bpy module (extra `blender`)")
    pytest.importorskip("pxr.Usd", reason="needs usd-core (extra `usd`)")
    path = tmp_path / f"ball.{suffix}"
    write_mesh_file(glossy(varying()), path, suffix[:3])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    read = bpy.ops.wm.obj_import if suffix == "obj" else bpy.ops.wm.usd_import
    assert read(filepath=str(path)) == {"FINISHED"}
    thing = next(one for one in bpy.data.objects if one.type == "MESH")
    tree = thing.data.materials[0].node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    linked = {"obj": "Specular IOR Level", "usdc": "IOR"}[suffix]
    assert shader.inputs[linked].is_linked and not shader.inputs["Specular Tint"].is_linked
    space = {"obj": ("specular", "sRGB"), "usdc": ("ior", "Non-Color")}[suffix]
    image = bpy.data.images[f"ball_{space[0]}.png"]
    assert image.colorspace_settings.name == space[1]


def test_names_begin_with_no_option(tmp_path: Path) -> None:
    write_mesh_file(glossy(), tmp_path / "-cup.obj", "obj")
    lines = (tmp_path / "_cup.mtl").read_text().splitlines()
    assert "map_Kd _cup_basecolor.png" in lines
    assert "mtllib _cup.mtl" in (tmp_path / "-cup.obj").read_text()


def test_blender_reads_the_usd(tmp_path: Path) -> None:
    bpy = pytest.importorskip("bpy", reason="needs the bpy module (extra `blender`)")
    pytest.importorskip("pxr.Usd", reason="needs usd-core (extra `usd`)")
    built = glossy()
    write_mesh_file(built, tmp_path / "ball.usdc", "usd")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.ops.wm.usd_import(filepath=str(tmp_path / "ball.usdc")) == {"FINISHED"}
    thing = next(one for one in bpy.data.objects if one.type == "MESH")
    assert len(thing.data.vertices) == len(built.mesh.vertices)
    places = np.array([thing.matrix_world @ v.co for v in thing.data.vertices])
    assert np.ptp(places, axis=0) == pytest.approx(
        np.ptp(built.mesh.vertices, axis=0)[[0, 2, 1]], rel=1e-4
    )
    shader = next(
        node for node in thing.data.materials[0].node_tree.nodes if node.type == "BSDF_PRINCIPLED"
    )
    assert shader.inputs["Roughness"].default_value == pytest.approx(0.3)
    assert shader.inputs["Base Color"].is_linked and shader.inputs["Normal"].is_linked


def test_without_usd_core_one_line_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.setitem(sys.modules, "pxr.Usd", None)
    with pytest.raises(InputError, match=r"needs usd-core: install it with `pip install") as caught:
        write_mesh_file(glossy(), tmp_path / "ball.usdc", "usd")
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("ball.obj", "fbx", 'unknown format "fbx": choose glb, obj, usd'),
        ("ball.txt", "obj", r"ends with \.obj"),
        ("ball.obj", "usd", r"ends with \.usd or \.usda or"),
    ],
)
def test_what_cannot_be_written_is_one_line(
    tmp_path: Path, name: str, kind: str, words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        write_mesh_file(glossy(), tmp_path / name, kind)
    assert "\n" not in str(caught.value)


def test_a_full_disk_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last file is the one that does not fit."""
    write = Path.write_bytes

    def fill(path: Path, content: bytes) -> int:
        if "normal" in path.name:
            write(path, content[:100])
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", fill)
    with pytest.raises(InputError, match="no space is left on the disk") as caught:
        write_mesh_file(glossy(), tmp_path / "ball.obj", "obj")
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())
