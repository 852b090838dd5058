"""Texture sets: every channel is the quantity that it is named after."""

import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.lobe_fitting.specular_level import SpecularFit, SpecularSource
from isc_core.result_files.arrays_file import mesh_of
from isc_core.result_files.exports import texture_set
from isc_core.result_files.exports.targets import TARGETS
from isc_core.result_files.exports.texture_set import texture_files, write_texture_set
from isc_core.result_files.mesh.build import build_mesh
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.mesh.result import MeshResult
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.part_of_result import ResultPart, cut_result
from isc_core.shading.ambient_occlusion import ambient_occlusion
from tests.core.ball_scene import ball

FITTED = SpecularSource.FITTED


def glossy(d: Decomposition, triangles: int = 3000, gloss: SpecularFit | None = None) -> MeshResult:
    given = gloss or SpecularFit(0.3, 0.5, FITTED, FITTED)
    options = MeshOptions(triangles=triangles)
    built = build_mesh(d.height, d.normal, d.mask, d.reflectance, options)
    return replace(built, gloss=given)


def written(target: str, folder: Path, built: MeshResult | None = None) -> Path:
    d = ball()
    cover = d.mask.astype(np.float32)
    write_texture_set(d, built or glossy(d), cover, target, folder, name="ball")
    return folder


def codes(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


def floats(path: Path) -> np.ndarray:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.asarray(file.channels()["Y"].pixels)


@pytest.fixture(scope="module")
def generic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written("generic", tmp_path_factory.mktemp("set") / "generic")


@pytest.mark.parametrize("target", TARGETS)
def test_every_target_has_the_files_that_its_description_names(target: str, tmp_path: Path) -> None:
    folder = written(target, tmp_path / "set")
    description = json.loads((folder / "ball_textures.json").read_text())
    assert description["target"] == target
    assert sorted(p.name for p in folder.iterdir()) == sorted(
        ["ball_textures.json", *description["files"].values()]
    )
    assert set(description["files"].values()) <= set(texture_files("ball"))
    sizes = {codes(path).shape[:2] for path in folder.glob("*.png")}
    assert sizes == {(96, 120)} and description["size"] == [120, 96]


def test_the_base_color_is_that_of_the_mesh_with_the_object_as_alpha(generic: Path) -> None:
    d, found = ball(), codes(generic / "ball_basecolor.png")
    assert found.dtype == np.uint8 and found.shape == (96, 120, 4)
    assert (found[..., 3] == 255 * d.mask).all()
    linear = srgb_to_linear(found[..., :3] / 255)
    assert np.abs(linear - glossy(d).base_color).max() < 0.005


def test_normals_are_opengl_or_directx(generic: Path, tmp_path: Path) -> None:
    d = ball()
    upward = codes(generic / "ball_normal.png").astype(int)
    downward = codes(written("unreal", tmp_path / "set") / "ball_normal.png").astype(int)
    assert np.abs(upward[d.mask] / 127.5 - 1 - d.normal[d.mask]).max() < 0.005
    top = np.argwhere(d.mask)[0]
    assert upward[tuple(top)][1] > 200 > 60 > downward[tuple(top)][1]
    assert (downward[..., 1] == 255 - upward[..., 1]).all()
    assert (downward[..., ::2] == upward[..., ::2]).all()
    assert (upward[0, 0] == [128, 128, 255]).all()


def test_the_mesh_has_a_normal_map_of_its_own_where_it_needs_one(
    generic: Path, tmp_path: Path
) -> None:
    built = glossy(ball())
    local = codes(generic / "ball_mesh_normal.png") / 127.5 - 1
    assert np.abs(local - built.detail).max() < 0.005
    folder = written("generic", tmp_path / "set", glossy(ball(), triangles=0))
    assert not (folder / "ball_mesh_normal.png").exists()


def test_roughness_and_specular_are_the_fitted_ones(generic: Path) -> None:
    assert (codes(generic / "ball_roughness.png") == round(255 * 0.3)).all()
    level = 0.5 * glossy(ball()).specular
    assert np.abs(codes(generic / "ball_specular.png") / 255 - level).max() < 0.003
    description = json.loads((generic / "ball_textures.json").read_text())
    assert description["roughness"] == {"value": 0.3, "source": "fitted"}
    assert description["specular"]["value"] == pytest.approx(level)


def test_a_level_that_varies_is_in_the_specular_texture(tmp_path: Path) -> None:
    d = ball()
    variation = np.where(np.indices(d.mask.shape)[1] > 60, 1.0, 0.5)
    built = glossy(d, gloss=SpecularFit(0.3, 0.5, FITTED, FITTED, variation))
    found = codes(written("generic", tmp_path / "set", built) / "ball_specular.png") / 255
    assert np.abs(found - 0.5 * built.specular * variation)[d.mask].max() < 0.003


@pytest.mark.slow
@pytest.mark.parametrize(("target", "shown"), [("unreal", 2.0), ("unity", 1.0)])
@pytest.mark.parametrize("varies", [False, True])
def test_the_base_color_is_under_the_gloss_that_the_program_shows(
    tmp_path: Path, target: str, shown: float, varies: bool
) -> None:
    """Textures hold levels up to 2; Unity has none, and shows plastic."""
    d = ball()
    stored, options = ResultPart.of(d), MeshOptions(triangles=3000)
    variation = np.where(np.indices(d.mask.shape)[1] > 66, 1.0, 0.25) if varies else None
    k = glossy(d).reflectance_scale

    def of(level: float, variation: np.ndarray | None) -> MeshResult:
        fit = SpecularFit(0.3, level / k, FITTED, FITTED, variation)
        return mesh_of(stored, options, gloss=fit)

    folder = written(target, tmp_path / "set", of(4.0, variation))
    found = codes(folder / "ball_basecolor.png")[..., :3]
    limited = None if variation is None or shown == 1 else np.minimum(variation / 0.5, 1.0)
    wanted = of(shown, limited).base_color_codes
    assert np.abs(found.astype(int) - wanted)[d.mask].max() <= 1
    assert np.abs(found.astype(int) - of(4.0, variation).base_color_codes).max() > 5


def test_height_has_its_scale_in_the_description(generic: Path) -> None:
    d, built = ball(), glossy(ball())
    whole, exact = codes(generic / "ball_height.png"), floats(generic / "ball_height.exr")
    assert whole.dtype == np.uint16 and exact.dtype == np.float32
    scale = json.loads((generic / "ball_textures.json").read_text())["height"]
    metres = (d.height - d.height[d.mask].min()) * built.metres_per_pixel
    assert np.abs(exact - metres)[d.mask].max() < 1e-8
    span = scale["metres_at_65535"] - scale["metres_at_0"]
    assert np.abs(whole / 65535 * span - metres)[d.mask].max() <= 0.51 * span / 65535 + 1e-9
    assert whole[d.mask].max() == 65535 and whole[d.mask].min() == 0


def test_the_occlusion_is_that_of_the_height_map(generic: Path) -> None:
    d = ball()
    expected = ambient_occlusion(d.height, d.mask)
    assert np.abs(codes(generic / "ball_ao.png") / 255 - expected)[d.mask].max() < 0.003


def test_all_textures_have_the_size_of_the_base_color(tmp_path: Path) -> None:
    """With a base colour of three times the maps, they are those of the ball between its pixels."""
    d = ball()
    height, width = (3 * n for n in d.mask.shape)
    variation = np.where(np.indices(d.mask.shape)[1] > 60, 1.0, 0.5)
    gloss = SpecularFit(0.3, 0.5, FITTED, FITTED, variation)
    texture = np.full((height, width, 3), 128, np.uint8)
    built = replace(glossy(d, gloss=gloss), texture=texture)
    for target in TARGETS:
        folder = written(target, tmp_path / target, built)
        assert {codes(path).shape[:2] for path in folder.glob("*.png")} == {(height, width)}
    folder = tmp_path / "generic"
    description = json.loads((folder / "ball_textures.json").read_text())
    assert description["size"] == [width, height]
    assert description["metres_per_pixel"] == pytest.approx(built.metres_per_pixel / 3)
    metres, normal = floats(folder / "ball_height.exr"), codes(folder / "ball_normal.png")
    assert metres.shape == (height, width)
    rows, columns = np.indices((height, width))
    x, y = ((columns + 0.5) / 3 - 0.5 - 66) / 40, (44.5 - (rows + 0.5) / 3) / 40
    inner = x**2 + y**2 < 0.6**2
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    level = (40 * z - d.height[d.mask].min()) * built.metres_per_pixel
    assert np.abs(metres - level)[inner].max() < 0.01 * built.metres_per_pixel
    assert np.abs(normal / 127.5 - 1 - np.dstack([x, y, z]))[inner].max() < 0.006
    detail = codes(folder / "ball_mesh_normal.png") / 127.5 - 1
    assert np.abs(np.linalg.norm(detail, axis=-1) - 1).max() < 0.01


def test_packed_channels(generic: Path, tmp_path: Path) -> None:
    roughness, ao = (codes(generic / f"ball_{name}.png") for name in ("roughness", "ao"))
    orm = codes(written("unreal", tmp_path / "unreal") / "ball_orm.png")
    assert (orm == np.dstack([ao, roughness, 0 * ao])).all()
    unity = written("unity", tmp_path / "unity")
    smooth = codes(unity / "ball_metallic_smoothness.png")
    assert (smooth[..., 0] == 0).all() and (smooth[..., 3] == 255 - roughness).all()
    packed = codes(unity / "ball_mask_map.png")
    assert (packed == np.dstack([0 * ao, ao, 0 * ao, 255 - roughness])).all()


def test_textures_continue_beyond_the_object(generic: Path) -> None:
    """So that filtering draws no rim of flat normals or black height."""
    d = ball()
    row = 44
    column = np.flatnonzero(d.mask[row])[-1]
    for name in ("normal", "height", "ao", "basecolor"):
        values = codes(generic / f"ball_{name}.png")[..., None][row, column - 0 : column + 3]
        colors = values.reshape(3, -1)[:, :3]
        assert (colors[1] == colors[0]).all() and (colors[2] == colors[0]).all(), name


def test_no_roughness_is_one_line_and_no_folder(tmp_path: Path) -> None:
    built = glossy(ball(), gloss=SpecularFit())
    with pytest.raises(InputError, match="no fitted roughness: give one, such as --roughness") as e:
        written("generic", tmp_path / "set", built)
    assert "\n" not in str(e.value)
    assert not list(tmp_path.iterdir())
    none = SpecularFit(None, 0.0, SpecularSource.NOT_FITTED, SpecularSource.NO_HIGHLIGHTS)
    folder = written("generic", tmp_path / "set", glossy(ball(), gloss=none))
    assert (codes(folder / "ball_roughness.png") == 255).all()


def test_an_unknown_target_and_a_foreign_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='unknown target "maya": choose generic, blender'):
        written("maya", tmp_path / "set")
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        written("generic", tmp_path / "set")
    assert [path.name for path in (tmp_path / "set").iterdir()] == ["mine.txt"]


def test_a_full_disk_leaves_the_earlier_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = written("generic", tmp_path / "set")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def full(path: Path, channels: object) -> None:
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(texture_set, "write_channels", full)
    with pytest.raises(InputError, match="no space is left on the disk") as caught:
        written("unreal", folder)
    assert "\n" not in str(caught.value)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert list(tmp_path.iterdir()) == [folder]


def test_textures_of_a_small_object_cover_its_part_of_the_frame(tmp_path: Path) -> None:
    d = ball((512, 700), 40.0, (330.0, 420.0))
    built = mesh_of(ResultPart.of(d), gloss=SpecularFit(0.3, 0.5, FITTED, FITTED))
    near = cut_result(d, built.place)
    write_texture_set(near, built, near.mask.astype(np.float32), "generic", tmp_path, name="ball")
    description = json.loads((tmp_path / "ball_textures.json").read_text())
    x, y, *frame = description["frame"]
    assert frame == [700, 512]
    width, height = description["size"]
    assert width * height < 0.5 * 700 * 512
    for path in tmp_path.glob("*.png"):
        assert codes(path).shape[:2] == (height, width)
    alpha = codes(tmp_path / "ball_basecolor.png")[..., 3]
    np.testing.assert_array_equal(alpha, 255 * d.mask[y : y + height, x : x + width])
    assert description["metres_per_pixel"] == pytest.approx(0.1 / 79)
    u, v = built.mesh.uv.T
    column, row = (u * width).astype(int), ((1 - v) * height).astype(int)
    assert (alpha[row, column] == 255).all()
