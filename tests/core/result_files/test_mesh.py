"""The mesh against surfaces known in closed form, and against what glTF prescribes."""

import io
import json
import struct
from dataclasses import replace
from functools import partial
from math import log, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.imaging.row_blocks import row_blocks
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.lobe_fitting.specular_level import SpecularFit, SpecularSource
from isc_core.result_files.mesh import base_color as base_color_module
from isc_core.result_files.mesh.base_color import base_color, dark_rings, nearest_inside
from isc_core.result_files.mesh.build import build_mesh
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.mesh.result import MeshResult
from isc_core.result_files.mesh.rim_heights import limit_rim
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.spherical_harmonics import real_sh
from tests.core.ball_scene import LIGHT, ball


def built(d: Decomposition, **options: Any) -> MeshResult:
    return build_mesh(d.height, d.normal, d.mask, d.reflectance, MeshOptions(**options))


def surface(result: MeshResult) -> tuple[np.ndarray, np.ndarray]:
    return result.mesh.vertices, result.mesh.faces


def reopened(result: MeshResult) -> trimesh.Trimesh:
    """The mesh as another program gets it: from the bytes of the file."""
    scene = trimesh.load(io.BytesIO(result.glb()), file_type="glb", process=False)
    (mesh,) = scene.geometry.values()
    return mesh


def texture(image: Image.Image) -> np.ndarray:
    return np.asarray(image.convert("RGB"))


def sampled(image: Image.Image, uv: np.ndarray) -> np.ndarray:
    """The texel at each of trimesh's texture coordinates, whose v counts from the bottom."""
    pixels = texture(image)
    row = np.clip(((1 - uv[:, 1]) * pixels.shape[0]).astype(int), 0, pixels.shape[0] - 1)
    column = np.clip((uv[:, 0] * pixels.shape[1]).astype(int), 0, pixels.shape[1] - 1)
    return pixels[row, column]


def gltf(blob: bytes) -> dict:
    """The JSON part of a .glb, read by the format's own words: header of 12 bytes, then length,
    type, text.
    """
    magic, version, total = struct.unpack_from("<4sII", blob)
    length, kind = struct.unpack_from("<I4s", blob, 12)
    assert (magic, version, total, kind) == (b"glTF", 2, len(blob), b"JSON")
    return json.loads(blob[20 : 20 + length])


def test_axes_are_those_of_gltf() -> None:
    """Right is +X, up is +Y, the viewer is at +Z; metres; faces turn their front to the viewer."""
    mesh = reopened(built(ball(), rim=0))
    assert np.ptp(mesh.vertices, axis=0).max() == pytest.approx(0.1, rel=0.02)
    assert np.abs(mesh.bounds.sum(0)).max() < 1e-6  # centred
    outward = mesh.vertices - [
        mesh.vertices[:, 0].mean(),
        mesh.vertices[:, 1].mean(),
        mesh.vertices[:, 2].max() - 40 * 0.1 / 79,
    ]
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    assert np.abs(outward - mesh.vertex_normals).max() < 0.02
    right, top = mesh.vertices[:, 0].argmax(), mesh.vertices[:, 1].argmax()
    assert mesh.vertex_normals[right, 0] > 0.9
    assert mesh.vertex_normals[top, 1] > 0.9
    assert (mesh.face_normals[:, 2] > 0).all()
    assert np.allclose(np.linalg.norm(mesh.vertex_normals, axis=-1), 1, atol=1e-5)


def test_all_vertices_are_used_and_only_whole_cells() -> None:
    mask = np.ones((7, 9), bool)
    mask[0] = mask[3, 4] = mask[6, :3] = False
    mask[0, 8] = True  # a pixel that hangs on by one side: no cell holds it
    d = ball()
    result = build_mesh(
        np.arange(63.0).reshape(7, 9),
        d.normal[:7, :9],
        mask,
        np.ones((7, 9, 3)),
        MeshOptions(rim=0),
    )
    cells = mask[:-1, :-1] & mask[1:, :-1] & mask[:-1, 1:] & mask[1:, 1:]
    assert len(result.mesh.faces) == 2 * cells.sum()
    assert set(np.unique(result.mesh.faces)) == set(range(len(result.mesh.vertices)))
    assert len(result.mesh.vertices) == np.count_nonzero(mask) - 1


def test_pixels_and_world_are_related_as_described() -> None:
    d = ball()
    result = built(d, metres_per_pixel=0.002, rim=0)
    row, column = 30, 80
    place = (
        np.array(
            [
                column - result.origin[0],
                result.origin[1] - row,
                d.height[row, column] - result.origin[2],
            ]
        )
        * 0.002
    )
    assert np.abs(result.mesh.vertices - place).max(-1).min() < 1e-9
    assert result.describe()["metres_per_pixel"] == 0.002


def test_the_texture_is_not_mirrored() -> None:
    """One coloured corner: it must be found at the mesh's top left, and the file's v must count
    from the top.
    """
    d = ball((40, 60), 100, (20, 30))
    albedo = np.full((40, 60, 3), 0.2)
    albedo[:8, :8] = [0.9, 0.0, 0.0]
    result = build_mesh(d.height, d.normal, np.ones((40, 60), bool), albedo, MeshOptions())
    mesh = reopened(result)
    red = sampled(mesh.visual.material.baseColorTexture, mesh.visual.uv)
    red = (red[:, 0] > 200) & (red[:, 1] < 10)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    assert red.sum() == 64
    assert x[red].max() < np.sort(x)[8 * 40]
    assert y[red].min() > np.sort(y)[-8 * 60 - 1]
    uv = accessor(result.glb(), "TEXCOORD_0")
    assert uv[red].max(0) == pytest.approx([7.5 / 60, 7.5 / 40])


def accessor(blob: bytes, attribute: str) -> np.ndarray:
    """A float attribute, straight from the file's bytes."""
    tree = gltf(blob)
    entry = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"][attribute]]
    view = tree["bufferViews"][entry["bufferView"]]
    width = {"VEC2": 2, "VEC3": 3, "VEC4": 4}[entry["type"]]
    start = (
        20
        + struct.unpack_from("<I", blob, 12)[0]
        + 8
        + view.get("byteOffset", 0)
        + entry.get("byteOffset", 0)
    )
    return np.frombuffer(blob, "<f4", entry["count"] * width, start).reshape(-1, width)


def test_the_base_color_gives_the_reflectance_back() -> None:
    d = ball()
    result = built(d)
    coded = texture(reopened(result).visual.material.baseColorTexture).astype(float)
    k = result.reflectance_scale
    assert np.percentile(k * d.reflectance[d.mask].max(-1), 99.5) == pytest.approx(0.9)
    truth = k * d.reflectance
    for side in (-0.5, 0.5):  # the truth lies within half a code value of what is stored
        edge = srgb_to_linear(np.clip((coded + side * 1.001) / 255, 0, 1))
        assert ((truth - edge)[d.mask] * np.sign(side) <= 1e-6).all()


def disc_with_a_border(width: int) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance and mask of a disc 400 pixels wide, whose border is darker."""
    y, x = np.mgrid[:410, :410] - 204.5
    mask = np.hypot(x, y) < 200
    depth = ndimage.distance_transform_edt(mask)
    light = np.where(depth > width, 0.5, 0.02) * mask
    return light[..., None] * np.array([1, 0.8, 0.6]), mask


def test_an_outline_that_fades_to_black_is_not_the_object() -> None:
    reflectance, mask = disc_with_a_border(3)
    assert dark_rings(reflectance, ndimage.distance_transform_edt(mask)) == 3
    color, k = base_color(reflectance, mask, 4)
    np.testing.assert_allclose(color[mask] / k, np.broadcast_to([0.5, 0.4, 0.3], (mask.sum(), 3)))


@pytest.mark.parametrize("width", [0, 12])
def test_a_plain_border_and_a_painted_one_are_the_object(width: int) -> None:
    reflectance, mask = disc_with_a_border(width)
    assert dark_rings(reflectance, ndimage.distance_transform_edt(mask)) == 0
    color, k = base_color(reflectance, mask, 4)
    np.testing.assert_allclose(color[mask] / k, reflectance[mask])


def test_base_color_and_its_light_give_the_diffuse_image() -> None:
    d = ball()
    result = built(d)
    light = result.illumination(d.illumination)
    rendered = result.reflectance_scale * d.reflectance * np.exp(real_sh(d.normal) @ light)
    assert np.abs(rendered - d.diffuse)[d.mask].max() < 1e-6
    assert light[0] == pytest.approx(LIGHT[0] - log(result.reflectance_scale) * sqrt(4 * pi))
    assert (light[1:] == LIGHT[1:]).all()


def test_the_texture_runs_on_beyond_the_mask() -> None:
    d = ball()
    color, _ = base_color(d.reflectance, d.mask, bleed=6)
    colors = {tuple(value) for value in color[d.mask]}
    rows, columns = np.nonzero(d.mask)
    assert len(colors) == 2
    assert {tuple(color[rows.min() - n, columns[rows.argmin()]]) for n in (1, 3, 5)} <= colors
    assert tuple(color[0, 0]) not in colors  # far out: the mean
    assert color.min() > 0.01  # nothing black anywhere


def test_a_black_object_has_a_black_texture() -> None:
    d = ball()
    color, k = base_color(np.zeros_like(d.reflectance), d.mask, bleed=6)
    assert color.max() == 0
    assert k == 1


def test_spikes_at_the_rim_go_and_a_ball_stays() -> None:
    d = ball((300, 300), 140, (150, 150))
    height = d.height.astype(float)
    change = np.abs(limit_rim(height, d.mask, 3) - height)  # of a radius of 140
    outermost = d.mask & (ndimage.minimum_filter(d.mask, 3) == 0)
    assert change[d.mask & ~outermost].max() < 1
    assert change[outermost].max() < 6
    assert change[outermost].mean() < 2
    rng = np.random.default_rng(5)
    depth = np.linalg.norm(np.argwhere(d.mask) - 150.0, axis=-1)
    rim = np.argwhere(d.mask)[depth > 0.99 * 140 - 1]
    spikes = rim[rng.choice(len(rim), 60, replace=False)]
    spiky = height.copy()
    spiky[tuple(spikes.T)] += rng.choice([-1, 1], 60) * rng.uniform(60, 400, 60)
    repaired = limit_rim(spiky, d.mask, 3)
    assert np.abs(spiky - height)[d.mask].max() > 300
    assert np.abs(repaired - height)[d.mask].max() < 25
    assert (repaired[~d.mask] == 0).all()
    inside = ndimage.minimum_filter(d.mask, 7)  # three rings away from the outside
    assert (repaired == height)[inside].all()  # only the rim is touched


@pytest.mark.slow
def test_a_steep_rim_has_no_teeth() -> None:
    """From the side, a ball's outline must be about as long as its great circle, not climb and fall
    at each step of the grid.
    """
    d = ball((300, 300), 140, (150, 150))
    lengths = {}
    for rim in (0, 3):
        mesh = trimesh.Trimesh(*surface(built(d, rim=rim, metres_per_pixel=1.0)), process=False)
        edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
        ends = mesh.vertices[edges[count == 1]]
        lengths[rim] = np.abs(ends[:, 0, 2] - ends[:, 1, 2]).sum()
    assert lengths[3] < 0.5 * lengths[0]


def test_a_large_map_is_simplified_to_the_requested_number_of_faces() -> None:
    d = ball((150, 190), 70, (73, 91))
    for most in (20_000, 5_000, 1_000):
        result = built(d, triangles=most)
        assert 0.99 * most <= len(result.mesh.faces) <= most  # equal errors are left out together
        mesh = reopened(result)
        assert np.ptp(mesh.vertices[:, 0]) == pytest.approx(0.1, rel=0.25)


def test_the_normal_map_contains_the_detail_that_a_simplified_mesh_lacks() -> None:
    """Fine waves on a ball: mesh and map together give the recovered normals, rebuilt here as glTF
    prescribes; the mesh alone does not.
    """
    d = ball((150, 190), 70, (73, 91))
    rows, columns = np.mgrid[:150, :190]
    normal = d.normal + np.stack(
        [0.25 * np.sin(1.9 * columns), 0.2 * np.cos(2.3 * rows), 0 * rows], -1
    )
    normal = np.where(d.mask[..., None] & (normal[..., 2:] > 0.3), normal, d.normal)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    result = built(replace(d, normal=normal), triangles=3_000, rim=0)
    mesh = reopened(result)
    assert len(result.mesh.faces) <= 3_000
    found: dict[str, list[float]] = {"alone": [], "with map": []}
    local = texture(mesh.visual.material.normalTexture) / 127.5 - 1
    for face in mesh.faces[::7]:
        weights = np.array([0.2, 0.5, 0.3])
        pixel = np.stack(
            [mesh.visual.uv[face, 0] * 190 - 0.5, (1 - mesh.visual.uv[face, 1]) * 150 - 0.5], -1
        )
        column, row = np.rint(weights @ pixel).astype(int)
        weights = np.linalg.solve(np.vstack([pixel.T, np.ones(3)]), [column, row, 1])
        base, tangent = (
            weights @ mesh.vertex_normals[face],
            tangent_of(mesh.vertices[face], mesh.visual.uv[face]),
        )
        base /= np.linalg.norm(base)
        tangent -= base * (tangent @ base)
        tangent /= np.linalg.norm(tangent)
        seen = local[row, column] @ np.stack([tangent, np.cross(base, tangent), base])
        for name, vector in (("alone", base), ("with map", seen / np.linalg.norm(seen))):
            found[name].append(np.degrees(np.arccos(np.clip(vector @ normal[row, column], -1, 1))))
    assert np.median(found["with map"]) < 2
    assert np.median(found["alone"]) > 5


def test_a_thinned_mesh_has_the_tangents_of_its_normal_map() -> None:
    blob = built(ball(), triangles=3_000).glb()
    tangent, normal = accessor(blob, "TANGENT"), accessor(blob, "NORMAL")
    assert (tangent[:, 3] == 1).all()
    np.testing.assert_allclose(np.linalg.norm(tangent[:, :3], axis=1), 1, atol=1e-6)
    np.testing.assert_allclose((tangent[:, :3] * normal).sum(1), 0, atol=1e-6)
    assert (tangent[:, 0] > 0).all(), "the column of the texture grows to the right"
    full = gltf(built(ball()).glb())["meshes"][0]["primitives"][0]["attributes"]
    assert "TANGENT" not in full, "its normal map is flat"


def tangent_of(corners: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The direction on a triangle in which u grows."""
    edges, steps = corners[1:] - corners[0], uv[1:] - uv[0]
    return np.linalg.solve(steps, edges)[0]


def test_a_mesh_with_a_vertex_at_each_pixel_lacks_nothing() -> None:
    d = ball()
    result = built(d)
    assert result.stride == 1
    mesh = reopened(result)
    row, column = (
        np.rint(part).astype(int)
        for part in ((1 - mesh.visual.uv[:, 1]) * 96 - 0.5, mesh.visual.uv[:, 0] * 120 - 0.5)
    )
    assert np.abs(mesh.vertex_normals - d.normal[row, column]).max() < 1e-5
    assert (texture(mesh.visual.material.normalTexture) == [128, 128, 255]).all()


def test_the_material_has_the_requested_factors() -> None:
    result = built(ball(), roughness=0.4)
    material = gltf(result.glb())["materials"][0]
    assert material["pbrMetallicRoughness"]["roughnessFactor"] == 0.4
    assert material["pbrMetallicRoughness"]["metallicFactor"] == 0
    assert {"baseColorTexture"} <= set(material["pbrMetallicRoughness"])
    assert "normalTexture" in material
    assert result.describe()["roughness"] == {"value": 0.4, "source": "not fitted"}


def glossy(
    specular: float, variation: np.ndarray | None = None, roughness: float = 0.3
) -> MeshResult:
    """The ball's mesh with a fitted gloss whose level for the base colour is `specular`."""
    d = ball()
    bare = built(d)
    gloss = SpecularFit(
        roughness,
        specular / bare.reflectance_scale,
        SpecularSource.FITTED,
        SpecularSource.FITTED,
        variation,
    )
    return replace(bare, gloss=gloss)


@pytest.mark.parametrize("level", [0.0, 0.4, 1.0, 3.0])
def test_a_fitted_gloss_is_in_the_file(level: float) -> None:
    result = glossy(level)
    tree = gltf(result.glb())
    material = tree["materials"][0]
    assert tree["extensionsUsed"] == ["KHR_materials_specular"]
    assert material["pbrMetallicRoughness"]["roughnessFactor"] == 0.3
    extension = material["extensions"]["KHR_materials_specular"]
    assert extension["specularFactor"] * max(
        extension.get("specularColorFactor", [1])
    ) == pytest.approx(level)
    assert extension["specularFactor"] <= 1
    described = result.describe()
    assert described["roughness"] == {"value": 0.3, "source": "fitted"}
    assert described["specular"]["value"] == pytest.approx(level)
    assert (described["specular"]["source"], described["specular"]["texture"]) == ("fitted", False)


def test_a_gloss_that_varies_is_a_texture_in_the_alpha_channel() -> None:
    d = ball()
    variation = np.where(np.indices(d.mask.shape)[1] > 60, 1.25, 0.5)
    blob = glossy(0.4, variation).glb()
    tree = gltf(blob)
    extension = tree["materials"][0]["extensions"]["KHR_materials_specular"]
    assert extension["specularFactor"] == pytest.approx(0.4 * 1.25)
    image = tree["images"][tree["textures"][extension["specularTexture"]["index"]]["source"]]
    view = tree["bufferViews"][image["bufferView"]]
    assert view["byteOffset"] % 4 == 0
    start = 20 + struct.unpack_from("<I", blob, 12)[0] + 8 + view["byteOffset"]
    with Image.open(io.BytesIO(blob[start : start + view["byteLength"]])) as picture:
        alpha = np.asarray(picture)[..., 3] / 255
    assert np.abs(alpha * extension["specularFactor"] - 0.4 * variation).max() < 0.002
    assert tree["buffers"][0]["byteLength"] == view["byteOffset"] + view["byteLength"]
    assert len(reopened(glossy(0.4, variation)).faces) > 100


@pytest.mark.parametrize("source", [SpecularSource.NOT_FITTED, SpecularSource.UPPER_BOUND])
def test_an_unknown_gloss_is_not_shown(source: str) -> None:
    """Without the extension viewers would show plastic."""
    d = ball()
    result = replace(built(d), gloss=SpecularFit(0.3, None, source, source))
    tree = gltf(result.glb())
    assert tree["extensionsUsed"] == ["KHR_materials_specular"]
    assert tree["materials"][0]["extensions"] == {"KHR_materials_specular": {"specularFactor": 0.0}}
    assert (result.describe()["specular"]["value"], result.describe()["specular"]["source"]) == (
        0.0,
        source,
    )


def test_equal_maps_give_equal_bytes() -> None:
    assert built(ball()).glb() == built(ball()).glb()


@pytest.mark.parametrize("scale", [1.0, 0.0])
def test_steep_or_flat_it_holds_no_nan(scale: float) -> None:
    d = ball()
    normal = d.normal.copy()
    normal[44, 30] = [1, 0, 0]
    result = build_mesh(scale * d.height, normal, d.mask, d.reflectance)
    assert np.isfinite(result.mesh.vertices).all()
    assert np.isfinite(result.mesh.vertex_normals).all()


def test_what_cannot_be_a_mesh_is_one_clear_line() -> None:
    d = ball()
    thin = np.zeros_like(d.mask)
    thin[40] = True
    broken = d.height.copy()
    broken[44, 60] = np.nan
    attempts = [
        (lambda: build_mesh(d.height, d.normal, thin, d.reflectance), "2 x 2"),
        (lambda: build_mesh(d.height, d.normal, np.zeros_like(thin), d.reflectance), "2 x 2"),
        (lambda: build_mesh(broken, d.normal, d.mask, d.reflectance), "height map has NaN"),
        (lambda: build_mesh(d.height[1:], d.normal, d.mask, d.reflectance), "one size"),
        (lambda: built(d, longest_side=0.0), "positive"),
        (lambda: built(d, metres_per_pixel=-1.0), "positive"),
    ]
    for attempt, words in attempts:
        with pytest.raises(InputError, match=words) as caught:
            attempt()
        assert "\n" not in str(caught.value)


def test_blender_opens_it_upright(tmp_path: Path) -> None:
    """Blender turns glTF's +Y into its +Z: right stays +X, the top is +Z, the viewer is at -Y."""
    bpy = pytest.importorskip("bpy", reason="needs the bpy module (extra `blender`)")
    d = ball()
    result = built(d)
    (tmp_path / "mesh.glb").write_bytes(result.glb())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.ops.import_scene.gltf(filepath=str(tmp_path / "mesh.glb")) == {"FINISHED"}
    thing = next(o for o in bpy.data.objects if o.type == "MESH")
    places = np.array([thing.matrix_world @ v.co for v in thing.data.vertices])
    assert len(places) == len(result.mesh.vertices)
    assert np.ptp(places, axis=0) == pytest.approx(
        np.ptp(result.mesh.vertices, axis=0)[[0, 2, 1]], rel=1e-4
    )
    normals = np.array(
        [
            thing.matrix_world.to_3x3() @ thing.data.corner_normals[i].vector
            for i in range(len(thing.data.loops))
        ]
    )
    loops = np.array([loop.vertex_index for loop in thing.data.loops])
    expected = (places - [0, places[:, 1].min() + 40 * result.metres_per_pixel, 0])[loops]
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    assert np.median((expected * normals).sum(-1)) > 0.999
    nodes = thing.data.materials[0].node_tree.nodes
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    assert shader.inputs["Roughness"].default_value == pytest.approx(0.5)
    assert shader.inputs["Base Color"].is_linked
    assert shader.inputs["Normal"].is_linked


@pytest.mark.parametrize(
    ("level", "varies"), [(0.4, False), (3.0, False), (0.0, False), (0.4, True)]
)
def test_blender_gets_the_fitted_gloss(tmp_path: Path, level: float, varies: bool) -> None:
    """Blender's level of 0.5 is the extension's 1."""
    bpy = pytest.importorskip("bpy", reason="needs the bpy module (extra `blender`)")
    variation = np.where(np.indices(ball().mask.shape)[1] > 60, 1.0, 0.5) if varies else None
    (tmp_path / "mesh.glb").write_bytes(glossy(level, variation).glb())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.ops.import_scene.gltf(filepath=str(tmp_path / "mesh.glb")) == {"FINISHED"}
    material = next(o for o in bpy.data.objects if o.type == "MESH").data.materials[0]
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    assert shader.inputs["Roughness"].default_value == pytest.approx(0.3)
    socket, tint = shader.inputs["Specular IOR Level"], shader.inputs["Specular Tint"].default_value
    assert shader.inputs["IOR"].default_value == pytest.approx(1.5)
    if varies:
        factor = socket.links[0].from_node
        assert factor.operation == "MULTIPLY"
        assert factor.inputs[1].default_value == pytest.approx(0.5 * level)
        assert factor.inputs[0].links[0].from_socket.name == "Alpha"
    else:
        assert socket.default_value * tint[0] == pytest.approx(0.5 * level)


def test_blender_shows_no_gloss_that_is_not_known(tmp_path: Path) -> None:
    """As the object that the add-on builds of the same result."""
    bpy = pytest.importorskip("bpy", reason="needs the bpy module (extra `blender`)")
    (tmp_path / "mesh.glb").write_bytes(built(ball()).glb())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.ops.import_scene.gltf(filepath=str(tmp_path / "mesh.glb")) == {"FINISHED"}
    material = next(o for o in bpy.data.objects if o.type == "MESH").data.materials[0]
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    assert shader.inputs["Specular IOR Level"].default_value == 0


def test_the_nearest_pixels_inside_are_those_of_the_whole_map(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(2)
    mask = ndimage.gaussian_filter(rng.normal(size=(90, 70)), 6) > 0.02
    away, places = ndimage.distance_transform_edt(~mask, return_indices=True)
    for pixels in (70, 1 << 18):  # one row at a time, and all of them
        monkeypatch.setattr(base_color_module, "row_blocks", partial(row_blocks, pixels=pixels))
        near, source = nearest_inside(mask, 5)
        assert np.array_equal(near, np.flatnonzero(~mask & (away <= 5)))
        assert np.array_equal(source, (places[0] * 70 + places[1]).ravel()[near])
        depth, exact = base_color_module._depth_near(mask, 4), ndimage.distance_transform_edt(mask)
        assert np.array_equal(depth[exact <= 4], exact[exact <= 4].astype(np.float32))
        assert (depth[exact > 4] > 4).all()
