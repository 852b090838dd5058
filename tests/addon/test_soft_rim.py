"""A soft rim in Blender: its material has an opacity, and exporters keep it."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.errors import InputError
from isc_core.result_files.arrays_file import write_arrays
from isc_core.result_files.mesh.object_cover import object_cover
from isc_core.scene.part_of_result import ResultPart
from tests.addon.scene_fixture import bump, write_result

CENTRE, RADIUS = (27.0, 38.0), 0.4 * 64 * 0.9**0.5  # of the bump


def cover(width: float) -> np.ndarray:
    """That of the bump's pixels; its rim is so many pixels wide on the right, one on the left."""
    row, column = np.indices((64, 88))
    away = np.hypot(row - CENTRE[0], column - CENTRE[1]) - RADIUS
    return np.clip(0.5 - away / np.where(column > CENTRE[1], width, 1), 0, 1)


def folder_of(path: Path, width: float) -> Path:
    """A result folder with the soft cover."""
    folder, d = write_result(path), bump()
    given = {**d.provenance.input, "mask_from": "alpha"}
    stored = ResultPart.of(replace(d, provenance=replace(d.provenance, input=given)))
    write_arrays(stored, folder / "arrays.npz", cover=object_cover(stored, cover(width)))
    return folder


@pytest.fixture(scope="module")
def soft(tmp_path_factory: pytest.TempPathFactory) -> ResultArrays:
    return read_result(folder_of(tmp_path_factory.mktemp("soft") / "bump", 12))


@pytest.fixture(scope="module")
def hard(tmp_path_factory: pytest.TempPathFactory) -> ResultArrays:
    return read_result(folder_of(tmp_path_factory.mktemp("hard") / "bump", 1))


@pytest.fixture
def enabled(blender: Any) -> Iterator[Any]:
    """Blender with the add-on enabled in its preferences, so that exporters ask it."""
    import addon_utils  # type: ignore[import-not-found]

    addon_utils.enable("blender_addon", default_set=True)
    yield blender
    addon_utils.disable("blender_addon", default_set=True)


def build(result: ResultArrays, back: str = "rounded") -> Any:
    from blender_addon.scene import BuildOptions, build_object

    built = build_object(result, BuildOptions(own_scene=False, back=back, triangles=3000))
    built.object.select_set(True)
    return built


def opacity(material: Any) -> Any:
    """The socket of the Principled BSDF."""
    nodes = material.node_tree.nodes
    return next(node for node in nodes if node.type == "BSDF_PRINCIPLED").inputs["Alpha"]


def image_behind(socket: Any) -> Any:
    """The image that a socket gets its values from."""
    while socket.links[0].from_node.type != "TEX_IMAGE":
        socket = socket.links[0].from_node.inputs[0]
    return socket.links[0].from_node.image


def grey(image: Any, channel: int) -> np.ndarray:
    width, height = image.size
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(height, width, 4)[::-1, :, channel]


def test_a_soft_rim_has_an_opacity_and_an_outline_none(
    blender: Any, soft: ResultArrays, hard: ResultArrays
) -> None:
    assert hard.cover is not None and hard.soft is None and hard.alpha is None
    assert not opacity(build(hard).material).is_linked
    material = build(soft).material
    image = image_behind(opacity(material))
    assert image.name == "bump_alpha" and image.colorspace_settings.name == "Non-Color"
    values, wanted = grey(image, 0), cover(12)
    partly = (wanted > 0.1) & (wanted < 0.9) & (np.arange(88) > 44)
    assert partly.sum() > 100 and np.abs(values - wanted)[partly].max() < 0.01
    assert (values[:, :26] == 1).all(), "the outline on the left"
    assert not opacity(build(hard).material).is_linked
    assert "bump_alpha" not in blender.data.images


def test_the_object_ends_where_the_cover_does(
    blender: Any, soft: ResultArrays, hard: ResultArrays, bump_folder: Path
) -> None:
    """On the right, the fur reaches further; a hard mask gives the outline that it always gave."""

    def extent(result: ResultArrays) -> tuple[float, float]:
        mesh = build(result).object.data
        x = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", x)
        pixels = x[::3] * result.longest_side / 0.1
        return float(pixels.min()), float(pixels.max())

    smooth, long = extent(hard), extent(soft)
    assert smooth[1] - smooth[0] == pytest.approx(2 * RADIUS, abs=0.15)
    assert long[1] - smooth[1] == pytest.approx(0.46 * 12, abs=0.8)
    assert long[0] == pytest.approx(smooth[0], abs=0.1)
    plain = read_result(bump_folder)
    assert plain.cover is None
    same = replace(plain, cover=plain.mask.astype(np.float32))
    assert extent(same) == extent(plain)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gltf", "usd"])
@pytest.mark.parametrize("edited", [False, True])
def test_exporters_keep_the_opacity(
    enabled: Any, soft: ResultArrays, tmp_path: Path, kind: str, edited: bool
) -> None:
    from blender_addon.materials.edit_nodes import dichromatic_node

    bpy, built = enabled, build(soft)
    if edited:
        node = dichromatic_node(built.material)
        assert node is not None
        node.inputs["Hue"].default_value = 0.8
    wanted = grey(image_behind(opacity(built.material)), 0)
    path = str(tmp_path / ("a.glb" if kind == "gltf" else "a.usdc"))
    if kind == "gltf":
        bpy.ops.export_scene.gltf(filepath=path, use_selection=True)
    else:
        bpy.ops.wm.usd_export(filepath=path, selected_objects_only=True)
        texture = bpy.data.images.load(str(usd_opacity(tmp_path / "a.usdc")))
        texture.colorspace_settings.name = "Non-Color"
        np.testing.assert_allclose(grey(texture, 0), wanted, atol=0.003)
        return
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)
    (material,) = bpy.data.materials
    socket = opacity(material)
    assert material.surface_render_method == "BLENDED" and socket.is_linked
    np.testing.assert_allclose(grey(image_behind(socket), 3), wanted, atol=0.003)


def usd_opacity(path: Path) -> Path:
    """The texture of the opacity in a USD file; Blender 5.1 and 5.3 do not import it."""
    pytest.importorskip("pxr", reason="needs the extra `usd`")
    from pxr import Usd, UsdShade

    stage = Usd.Stage.Open(str(path))
    shaders = [UsdShade.Shader(prim) for prim in stage.Traverse()]
    (surface,) = (one for one in shaders if one and one.GetShaderId() == "UsdPreviewSurface")
    source, output, _ = surface.GetInput("opacity").GetConnectedSource()
    assert output == "r"
    texture = UsdShade.Shader(source.GetPrim()).GetInput("file").Get()
    return path.parent / str(texture.path)


@pytest.mark.slow
@pytest.mark.parametrize("back", ["open", "rounded"])
def test_what_is_seen_through_the_rim_is_what_the_object_does_not_cover(
    blender: Any, soft: ResultArrays, tmp_path: Path, back: str
) -> None:
    from blender_addon.scene import BuildOptions, build_object
    from tests.addon.scene_render import render

    built = build_object(soft, BuildOptions(back=back, triangles=0))
    built.scene.render.film_transparent = True
    seen, wanted = render(built.scene, tmp_path, 64)["Combined"][..., 3], cover(12)
    right = np.arange(88) > 44
    off = np.abs(seen - wanted)[(wanted > 0.1) & right]
    assert off.mean() < 0.04 and np.percentile(off, 95) < 0.15
    assert ((seen > 0.5) == (wanted > 0.5))[(np.abs(wanted - 0.5) > 0.3) | ~right].mean() > 0.995


def test_an_opacity_of_another_kind_is_refused(soft: ResultArrays, tmp_path: Path) -> None:
    arrays = dict(np.load(soft.folder / "arrays.npz"))
    folder = tmp_path / "bump"
    folder.mkdir()
    (folder / "decomposition.json").write_bytes((soft.folder / "decomposition.json").read_bytes())
    for name, wrong in (("alpha", np.zeros((4, 4), np.float32)), ("soft", np.zeros((2, 2), bool))):
        np.savez(folder / "arrays.npz", **{**arrays, name: wrong})
        with pytest.raises(InputError, match=name):
            read_result(folder)


def test_the_texture_set_has_the_opacity(enabled: Any, soft: ResultArrays, tmp_path: Path) -> None:
    from PIL import Image

    enabled.context.view_layer.objects.active = build(soft).object
    enabled.ops.isc.export_textures(directory=str(tmp_path))
    with Image.open(tmp_path / "bump" / "bump_basecolor.png") as image:
        alpha = np.asarray(image)[..., 3] / 255
    wanted = cover(12)
    partly = (wanted > 0.1) & (wanted < 0.9) & (np.arange(88) > 44)
    assert np.abs(alpha - wanted)[partly].max() < 0.01
    assert alpha[:, :8].max() == 0 and alpha[27, 38] == 1
