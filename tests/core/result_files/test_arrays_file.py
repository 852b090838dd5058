"""The plain arrays of a result: the same scene as its maps and mesh, and light that gives the photo
back.
"""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from isc_core.cli.main import main
from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.lobe_fitting import fit_lobe
from isc_core.lobe_fitting.specular_level import SpecularFit, fitted_specular
from isc_core.result_files.arrays_file import ARRAYS, arrays_of, mesh_of, write_arrays
from isc_core.result_files.mesh.build import build_mesh
from isc_core.result_files.mesh.object_cover import ObjectCover
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.mesh.result import MeshResult
from isc_core.result_files.mesh.texture_codes import color_codes
from isc_core.result_files.result_folder import load, require_room, save
from isc_core.result_files.solids.back import Back
from isc_core.scene.decomposition import COLOR_MAPS, Decomposition
from isc_core.scene.part_of_result import ResultPart
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.environment_map import shading_under
from isc_core.shading.radiance import directional, radiance
from isc_core.shading.spherical_harmonics import real_sh
from tests.core.ball_scene import ball

Arrays = dict[str, np.ndarray]


def built(d: Decomposition, **options: Any) -> MeshResult:
    return build_mesh(d.height, d.normal, d.mask, d.reflectance, MeshOptions(**options))


def read(path: Path) -> Arrays:
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result with arrays."""
    path = tmp_path_factory.mktemp("arrays") / "ball"
    save(ball(), path, arrays=True)
    return path


@pytest.fixture(scope="module")
def arrays(folder: Path) -> Arrays:
    return read(folder / ARRAYS)


@pytest.mark.slow
def test_the_maps_are_those_of_the_result(arrays: Arrays) -> None:
    d = ball()
    for name in (*COLOR_MAPS, "normal", "height", "confidence", "mask"):
        assert np.array_equal(arrays[name], getattr(d, name)), name
    integers = ("faces", "vertex_pixel", "photo_size", "frame")
    whole = {"mask": bool, **dict.fromkeys(integers, np.int32)}
    assert {name: values.dtype for name, values in arrays.items()} == {
        name: whole.get(name, np.float32) for name in arrays
    }
    assert arrays["photo_size"].tolist() == [120, 96] and arrays["crop_scale"] == 1


@pytest.mark.slow
def test_the_mesh_is_that_of_the_glb(arrays: Arrays, folder: Path) -> None:
    (mesh,) = trimesh.load(folder / "mesh.glb", process=False).geometry.values()
    assert np.array_equal(arrays["faces"], mesh.faces)
    np.testing.assert_allclose(arrays["vertices"], mesh.vertices, atol=1e-7)
    np.testing.assert_allclose(arrays["vertex_normals"], mesh.vertex_normals, atol=1e-6)
    np.testing.assert_allclose(arrays["uv"], mesh.visual.uv, atol=1e-6)
    record = json.loads((folder / "decomposition.json").read_text())["mesh"]
    assert arrays["reflectance_scale"] == pytest.approx(record["reflectance_scale"])
    assert arrays["origin"] == pytest.approx(list(record["origin"].values()))
    np.testing.assert_allclose(
        arrays["mesh_illumination"], record["illumination"]["coefficients"], rtol=1e-6
    )


def test_vertices_have_the_indices_of_their_pixels(arrays: Arrays) -> None:
    row, column = arrays["vertex_pixel"].T
    place = (
        np.stack([column - arrays["origin"][0], arrays["origin"][1] - row], -1)
        * arrays["metres_per_pixel"]
    )
    np.testing.assert_allclose(arrays["vertices"][:, :2], place, atol=1e-7)
    np.testing.assert_allclose(
        arrays["uv"], np.stack([(column + 0.5) / 120, 1 - (row + 0.5) / 96], -1), atol=1e-6
    )
    assert arrays["mask"][row, column].all()


def test_base_color_and_its_light_give_the_diffuse_image(arrays: Arrays) -> None:
    mask = arrays["mask"]
    np.testing.assert_allclose(
        arrays["base_color"][mask],
        (arrays["reflectance_scale"] * arrays["reflectance"])[mask],
        rtol=1e-6,
    )
    shading = np.exp(real_sh(arrays["normal"][mask].astype(float)) @ arrays["mesh_illumination"])
    np.testing.assert_allclose(
        arrays["base_color"][mask] * shading, arrays["diffuse"][mask], rtol=1e-4
    )
    assert arrays["base_color"][~mask].min() > 0


def test_the_sky_lights_the_base_color_as_the_photo_shows_it(arrays: Arrays) -> None:
    mask = arrays["mask"]
    shading = shading_under(arrays["sky"].astype(float), arrays["normal"][mask].astype(float))
    wanted = arrays["shading"][mask] / arrays["reflectance_scale"]
    assert np.sqrt(np.mean((shading / wanted - 1) ** 2)) < 0.03
    assert arrays["sky"].min() >= 0


def test_the_sun_explains_the_shading(arrays: Arrays) -> None:
    mask, k = arrays["mask"], arrays["reflectance_scale"]
    facing = np.maximum(arrays["normal"][mask] @ arrays["sun_direction"], 0)
    shading = facing[:, None] * arrays["sun_strength"] / np.pi + arrays["sun_ambient"]
    wanted = arrays["shading"][mask] / k
    assert np.linalg.norm(arrays["sun_direction"]) == pytest.approx(1)
    left = np.square(shading - wanted).sum() / np.square(wanted - wanted.mean(0)).sum()
    assert 1 - left == pytest.approx(float(arrays["sun_explained"]), abs=0.02)
    assert arrays["sun_explained"] > 0.9


@pytest.mark.slow
def test_detail_stays_where_vertices_are_few() -> None:
    """Vertex normal and normal map together are the recovered normals, without rounding to
    codes.
    """
    d = ball()
    mesh = built(d, triangles=3000)
    arrays = arrays_of(d, mesh)
    assert len(mesh.mesh.faces) <= 3000
    row, column = arrays["vertex_pixel"].T
    base = arrays["vertex_normals"].astype(float)
    tangent = np.stack([base[:, 2], 0 * base[:, 0], -base[:, 0]], -1)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    local = 2 * arrays["normal_map"][row, column] - 1
    normal = local[:, :1] * tangent + local[:, 1:2] * np.cross(base, tangent) + local[:, 2:] * base
    changed = np.abs(local - [0, 0, 1]).max(-1) > 1e-6
    assert changed.mean() > 0.5  # the others are surrounded by vertices
    np.testing.assert_allclose(normal[changed], d.normal[row, column][changed], atol=1e-5)


def glossy() -> Decomposition:
    """The ball under the gloss of one light, with the lobe that fits it."""
    d = ball()
    lamp = np.array([-0.37, 0.46, 0.807]) / np.linalg.norm([-0.37, 0.46, 0.807])
    gloss = 0.6 * radiance(
        Ggx(0.2, 0.04), d.normal.astype(float), np.array([0.0, 0, 1]), directional(lamp, 1.0)
    )
    specular = np.where(d.mask[..., None], gloss, 0).astype(np.float32)
    return replace(
        d, image=d.diffuse + specular, specular=specular, brdf=fit_lobe(specular, d.normal, d.mask)
    )


@pytest.mark.slow
def test_the_gloss_is_the_fitted_one(tmp_path: Path, arrays: Arrays) -> None:
    d = glossy()
    save(d, tmp_path / "out", arrays=True)
    found, gloss = read(tmp_path / "out" / ARRAYS), fitted_specular(d)
    assert found["roughness"] == pytest.approx(gloss.roughness) == pytest.approx(0.2**0.5, rel=0.05)
    assert gloss.specular is not None and d.brdf is not None
    assert found["specular_level"] == pytest.approx(
        float(found["reflectance_scale"]) * gloss.specular
    )
    assert np.array_equal(found["lobe"], d.brdf.predicted.astype(np.float32))
    assert ("specular_variation" in found) == (gloss.variation is not None)
    assert (
        np.isnan(arrays["roughness"])
        and np.isnan(arrays["specular_level"])
        and not arrays["lobe"].any()
    )


@pytest.mark.slow
def test_files_have_the_base_color_under_their_gloss_and_arrays_the_plain_one() -> None:
    """Under the recovered light what is below the layer is darker by what that mirrors."""
    d = glossy()
    built = mesh_of(ResultPart.of(d))
    layer = built.coated.layer(built.specular, built.roughness) if built.coated else None
    assert layer is not None and built.describe()["base_color"].endswith("under the gloss")
    plain, under = color_codes(built.base_color), built.base_color_codes
    np.testing.assert_array_equal(under, color_codes(layer.color_under(built.base_color)))
    facing = d.mask & (d.normal[..., 2] > 0.6)
    assert under[facing].mean() < plain[facing].mean() - 0.5
    np.testing.assert_array_equal(
        arrays_of(d, built)["base_color"], built.base_color.astype(np.float32)
    )
    matt = replace(built, gloss=replace(built.gloss, specular=0.0))
    np.testing.assert_array_equal(matt.base_color_codes, plain)
    assert matt.describe()["base_color"] == "k * reflectance"
    finer = replace(built, texture=np.repeat(np.repeat(plain, 2, 0), 2, 1))
    assert np.abs(finer.base_color_codes[::2, ::2].astype(int) - under)[facing].max() <= 4


@pytest.mark.slow
def test_the_command_gives_the_same_bytes_as_the_option(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(ball(), tmp_path / "later")
    assert not (tmp_path / "later" / ARRAYS).exists()
    assert main(["arrays", str(tmp_path / "later")]) == 0
    assert capsys.readouterr().out == f"wrote {tmp_path / 'later' / ARRAYS}\n"
    assert (tmp_path / "later" / ARRAYS).read_bytes() == (folder / ARRAYS).read_bytes()
    load(tmp_path / "later")
    save(
        ball(), tmp_path / "later"
    )  # a result with arrays is still one of ours, and its arrays do not outlive it
    assert not (tmp_path / "later" / ARRAYS).exists()


@pytest.mark.slow
def test_too_little_disk_space_for_arrays_is_detected_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=50_000_000))
    require_room(tmp_path / "out", 1_000_000)
    with pytest.raises(InputError, match="no space is left"):
        require_room(tmp_path / "out", 1_000_000, arrays=True)
    monkeypatch.undo()
    maps = [
        values.nbytes
        for values in arrays_of(ball(), built(ball())).values()
        if values.shape[:2] == (96, 120)
    ]
    assert sum(maps) == 129 * 96 * 120


def test_a_folder_without_a_result_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["arrays", "--quiet", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1 and "not a result folder" in message
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("triangles", [0, 800])
@pytest.mark.parametrize("back", list(Back))
def test_a_mesh_does_not_depend_on_the_frame_around_it(triangles: int, back: Back) -> None:
    """Only the part around the object is processed; all is in the frame of the maps."""
    d = ball((512, 700), 40.0, (330.0, 420.0))
    options = MeshOptions(triangles=triangles, back=back)
    found = mesh_of(ResultPart.of(d), options)
    whole = build_mesh(d.height, d.normal, d.mask, d.reflectance, options)
    # The sides and the back are a guess, by means over blocks that begin elsewhere.
    tolerance = 1e-9 if back is Back.OPEN else 0.5
    difference = (found.mesh.vertices - whole.mesh.vertices) / whole.metres_per_pixel
    assert np.abs(difference[:, :2]).max() < 1e-9
    assert np.abs(difference[:, 2]).max() < tolerance
    assert _sets(found.mesh.faces) == _sets(whole.mesh.faces) or back is not Back.OPEN
    part = found.place
    (x, y), (rows, columns) = part.corner, found.detail.shape[:2]
    assert part.share < 0.5
    places = found.mesh.uv * (columns, rows) + (x, 512 - y - rows)
    np.testing.assert_allclose(places / (700, 512), whole.mesh.uv, atol=5e-4)
    np.testing.assert_array_equal(found.vertex_pixel + (y, x), whole.vertex_pixel)
    np.testing.assert_allclose(
        list(found.describe()["origin"].values()), whole.origin, atol=tolerance
    )
    np.testing.assert_array_equal(found.detail, part.cut(whole.detail))
    np.testing.assert_array_equal(found.base_color, part.cut(whole.base_color))


def _sets(faces: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(sorted(face)) for face in faces.tolist()}


def test_the_texture_under_the_gloss_does_not_depend_on_the_frame() -> None:
    near, far = ball((128, 128), 40.0, (60.0, 60.0)), ball((512, 700), 40.0, (316.0, 444.0))
    gloss = SpecularFit(0.3, 0.8)
    small, large = (mesh_of(ResultPart.of(d), gloss=gloss) for d in (near, far))
    assert small.has_layer
    codes = large.base_color_codes
    part = large.place
    inside = part.cut(far.mask)
    assert codes.shape == (*inside.shape, 3)
    difference = codes[inside].astype(int) - small.base_color_codes[near.mask]
    assert np.abs(difference).max() <= 1


@pytest.mark.parametrize("factor", [1.0, 1.6, 2.371])
def test_arrays_and_texture_of_a_part_agree(tmp_path: Path, factor: float) -> None:
    """A texture pixel of the part is that of the frame."""
    d = ball((512, 700), 40.0, (330.0, 420.0))
    soft = d.mask & (np.arange(700) % 9 == 0)
    share = np.where(soft, 0.6, d.mask).astype(np.float32)
    cover = ObjectCover(share, soft, np.rint(255 * share).astype(np.uint8))
    shape = (round(512 * factor), round(700 * factor))
    texture = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    built = mesh_of(ResultPart.of(d), finer=shape[1] / 700)
    write_arrays(ResultPart.of(d), tmp_path / ARRAYS, built, texture if factor > 1 else None, cover)
    arrays = read(tmp_path / ARRAYS)
    x, y, width, height = arrays["frame"]
    assert (width, height) == (700, 512)
    rows, columns = arrays["mask"].shape
    assert rows * columns < 0.5 * 512 * 700
    part = np.s_[y : y + rows, x : x + columns]
    np.testing.assert_array_equal(arrays["diffuse"], d.diffuse[part])
    np.testing.assert_array_equal(arrays["cover"], share[part])
    np.testing.assert_array_equal(arrays["soft"], soft[part])
    factor = shape[1] / 700
    left, top = round(x * factor), round(y * factor)
    assert abs(x * factor - left) < 0.03 > abs(y * factor - top)
    if factor > 1:
        size = arrays["texture"].shape
        assert np.abs(np.array(size[:2]) - np.array([rows, columns]) * factor).max() < 0.06
        expected = texture[top : top + size[0], left : left + size[1]]
        np.testing.assert_array_equal(arrays["texture"], expected)
    alpha = cover.alpha(FramePart.whole(shape))
    assert alpha is not None
    size = arrays["alpha"].shape
    np.testing.assert_array_equal(
        arrays["alpha"], alpha[top : top + size[0], left : left + size[1]]
    )
    outlined = mesh_of(ResultPart.of(d), cover=cover, finer=factor)
    outlined = outlined.with_texture(texture) if factor > 1 else outlined
    np.testing.assert_array_equal(outlined.alpha, arrays["alpha"])
