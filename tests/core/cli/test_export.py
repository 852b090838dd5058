"""`isc export`: what it writes, and one line for what it cannot."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from isc_core.cli.main import main
from isc_core.lobe_fitting import fit_lobe
from isc_core.photo.camera import Camera
from isc_core.result_files import maps_file
from isc_core.result_files.arrays_file import ARRAYS
from isc_core.result_files.mesh.build import build_mesh
from isc_core.result_files.mesh.object_cover import read_cover
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.result_folder import load, load_part, save
from isc_core.result_files.solids.back import Back
from isc_core.scene.decomposition import COLOR_MAPS
from tests.core.ball_scene import ball
from tests.core.command_line import ball_photo, run_isc


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball whose lobe is known."""
    d, folder = ball(), tmp_path_factory.mktemp("results") / "ball"
    save(replace(d, brdf=fit_lobe(d.specular, d.normal, d.mask)), folder)
    return folder


@pytest.fixture(scope="module")
def unfitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results") / "plain"
    save(ball((48, 60), 20.0, (22, 33)), folder)
    return folder


def exported(*arguments: object) -> int:
    return main(["export", *map(str, arguments)])


def test_textures_are_named_after_the_photo_or_by_option(result: Path, tmp_path: Path) -> None:
    assert exported(result, "--textures", "unreal", "-o", tmp_path / "a") == 0
    assert (tmp_path / "a" / "ball_orm.png").is_file()
    again = [result, "--textures", "generic", "--name", "my mug", "-o", tmp_path / "b"]
    assert exported(*again, "--roughness", "0.25") == 0
    description = json.loads((tmp_path / "b" / "my_mug_textures.json").read_text())
    assert description["roughness"] == {"value": 0.25, "source": "given"}
    assert description["photo"] == "ball.png"


def test_the_mesh_has_the_requested_number_of_triangles(result: Path, tmp_path: Path) -> None:
    faces = {}
    for most in (0, 2000):
        path = tmp_path / f"ball{most}.glb"
        assert exported(result, "--format", "glb", "--triangles", most, "-o", path) == 0
        faces[most] = len(trimesh.load(path, force="mesh").faces)
    assert faces[0] > 4000 and 1900 < faces[2000] <= 2000
    assert (tmp_path / "ball0.glb").read_bytes() == (result / "mesh.glb").read_bytes()


@pytest.mark.parametrize("back", ["rounded", "mirrored", "flat"])
def test_a_mesh_with_a_back_is_closed(result: Path, tmp_path: Path, back: str) -> None:
    front, path = tmp_path / "front.glb", tmp_path / "ball.glb"
    given = [result, "--format", "glb", "--triangles", 4000]
    assert exported(*given, "-o", front) == 0
    assert exported(*given, "--back", back, "-o", path) == 0
    seen, mesh = (trimesh.load(one, force="mesh") for one in (front, path))
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    assert 3800 < len(mesh.faces) <= 4000
    np.testing.assert_allclose(mesh.extents[:2], seen.extents[:2], rtol=0.06)
    deepest = 1.6 if back == "rounded" else 1.05
    assert mesh.extents[2] > deepest * seen.extents[2]


def test_one_triangle_is_the_least_that_the_outline_allows(result: Path, tmp_path: Path) -> None:
    faces = []
    for most in (1, 1000):
        path = tmp_path / f"ball{most}.glb"
        given = [result, "--format", "glb", "--back", "rounded", "--triangles", most, "-q"]
        assert exported(*given, "-o", path) == 0
        faces.append(len(trimesh.load(path, force="mesh").faces))
    assert faces[0] == faces[1] < 4000


@pytest.mark.parametrize("back", ["open", "rounded", "flat"])
def test_a_soft_rim_counts_among_the_triangles(fur: Path, tmp_path: Path, back: str) -> None:
    path = tmp_path / "fur.glb"
    given = [fur, "--format", "glb", "--back", back, "--triangles", 6000, "-q", "-o", path]
    assert exported(*given) == 0
    assert 3000 < len(trimesh.load(path, force="mesh").faces) <= 6000


@pytest.mark.parametrize("back", ["open", "rounded"])
def test_a_photo_seen_in_perspective_has_a_back_on_its_rays(back: str) -> None:
    """The outline is that of the open mesh, as the camera sees it."""
    camera = Camera(90.0, (40.0, 36.0))
    row, column = np.indices((72, 80)) + 0.5
    distance = np.hypot(row - 36, column - 40)
    mask = distance < 24
    height = np.sqrt(np.maximum(24**2 - distance**2, 0))
    normal = np.dstack([column - 40, 36 - row, height]) / 24
    built = build_mesh(
        height,
        normal,
        mask,
        mask[..., None] * np.ones(3),
        MeshOptions(back=Back(back)),
        camera,
    )
    assert built.eye is not None
    ray = built.mesh.vertices - built.eye
    seen = ray[:, :2] / -ray[:, 2:] * camera.focal_length + (0, 0)
    assert np.hypot(*seen.T).max() == pytest.approx(24, abs=1.0)
    assert built.mesh.vertices[:, 2].min() < (-0.02 if back == "rounded" else 0)


@pytest.mark.parametrize("what", [["--textures", "generic"], ["--format", "obj"]])
def test_the_photo_gives_a_finer_base_color(tmp_path: Path, what: list[str]) -> None:
    photo, folder = ball_photo(tmp_path), tmp_path / "result"
    words = ["decompose", str(photo), "-q", "--model", "naive", "--max-size", "24"]
    assert main([*words, "-o", str(folder)]) == 0
    out = tmp_path / ("out" if what[0] == "--textures" else "out/mesh.obj")
    (tmp_path / "out").mkdir()
    given = [folder, "-q", "--roughness", "0.5", *what, "-o", out]
    sizes = []
    fine = ["--photo", photo]
    for more in ([], fine, [*fine, "--texture-size", "50"], [*fine, "--texture-size", "maps"]):
        assert exported(*given, *more) == 0
        (picture,) = (tmp_path / "out").glob("*_basecolor.png")
        sizes.append(max(Image.open(picture).size))
    assert sizes[0] == sizes[3] < sizes[2] <= 50 < sizes[1]


def test_a_texture_does_not_replace_the_photo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo = ball_photo(tmp_path).rename(tmp_path / "cup_basecolor.png")
    words = ["decompose", str(photo), "-q", "--model", "naive", "--max-size", "24"]
    assert main([*words, "-o", str(tmp_path / "result")]) == 0
    before = photo.read_bytes()
    given = [tmp_path / "result", "--format", "obj", "--photo", photo]
    assert exported(*given, "-o", tmp_path / "cup.obj") == 2
    assert "choose another name" in capsys.readouterr().err
    assert photo.read_bytes() == before and not (tmp_path / "cup.obj").exists()


def test_a_texture_set_does_not_replace_the_photo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo = ball_photo(tmp_path)
    words = ["decompose", str(photo), "-q", "--model", "naive", "--max-size", "24"]
    assert main([*words, "-o", str(tmp_path / "result")]) == 0
    given = [tmp_path / "result", "--textures", "generic", "--roughness", "0.5", "-q"]
    assert exported(*given, "--name", "cup", "-o", tmp_path / "set") == 0
    photo = photo.rename(tmp_path / "set" / "cup_basecolor.png")
    before = photo.read_bytes()
    again = [*given, "--name", "cup", "--photo", photo, "-o", tmp_path / "set"]
    assert exported(*again) == 2
    assert "choose another folder" in capsys.readouterr().err
    assert photo.read_bytes() == before


def test_another_photo_is_refused(
    result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [result, "-q", "--format", "glb", "--photo", ball_photo(tmp_path)]
    assert exported(*given, "-o", tmp_path / "ball.glb") == 2
    assert "is not the photo of" in capsys.readouterr().err
    assert not (tmp_path / "ball.glb").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--textures", "maya", "-o", "out"], "invalid choice: 'maya'"),
        (["--format", "fbx", "-o", "out.fbx"], "invalid choice: 'fbx'"),
        (["-o", "out"], "one of the arguments --textures --format is required"),
        (["--textures", "unity", "--format", "obj", "-o", "out"], "not allowed with"),
        (["--format", "obj", "-o", "out.glb"], "give a name that ends with .obj"),
        (["--textures", "unity", "-o", "out"], "no fitted roughness: give one"),
        (["--textures", "unity", "--roughness", "2", "-o", "out"], "not a number from 0 to 1"),
        (["--textures", "unity", "--triangles", "-3", "-o", "out"], "not a whole number, 0 or"),
        (["--textures", "unity", "--back", "flat", "-o", "out"], "add --format, or leave it out"),
        (["--format", "glb", "--back", "round", "-o", "out.glb"], "invalid choice: 'round'"),
        (["--format", "glb", "--texture-size", "90", "-o", "out.glb"], "require --photo"),
        (
            ["--format", "glb", "--texture-size", "0", "-o", "out.glb"],
            "not photo, maps or a number",
        ),
        (["--format", "glb", "--photo", "none.png", "-o", "out.glb"], "none.png"),
    ],
)
def test_what_cannot_be_exported_is_one_line(
    unfitted: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert exported(unfitted, "-q", *arguments) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_what_is_no_result_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "photos").mkdir()
    for folder in ("photos", "absent"):
        given = [tmp_path / folder, "-q", "--textures", "unity", "-o", tmp_path / "out"]
        assert exported(*given) == 2
        error = capsys.readouterr().err
        assert "is not a result folder" in error and error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["photos"]


# From the moment when the result has been read, no file may have more than 9,000 bytes.
LIMIT = """import resource, signal
import isc_core.cli.commands.export as command
build = command.mesh_of
def limited(*arguments, **options):
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (9000, 9000))
    return build(*arguments, **options)
command.mesh_of = limited"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "output"), [(["--textures", "generic"], "set"), (["--format", "obj"], "ball.obj")]
)
def test_a_disk_that_takes_no_more_leaves_nothing(
    result: Path, tmp_path: Path, what: list[str], output: str
) -> None:
    done = run_isc("export", result, "-q", *what, "-o", tmp_path / output, before=LIMIT)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "cannot write" in done.stderr
    assert not list(tmp_path.iterdir())


def soft_result(folder: Path, width: float) -> Path:
    """A ball from a photo with an alpha channel, whose rim is so many pixels wide on the right."""
    d = ball()
    given = {**d.provenance.input, "mask_from": "alpha"}
    d = replace(d, provenance=replace(d.provenance, input=given))
    row, column = np.indices(d.mask.shape)
    away = np.hypot(row - 44, column - 66) - 0.99 * 40
    cover = np.clip(0.5 - away / np.where(column > 66, width, 1), 0, 1)
    save(d, folder, cover=cover)
    return folder


@pytest.fixture(scope="module")
def fur(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return soft_result(tmp_path_factory.mktemp("results") / "fur", 14)


@pytest.fixture(scope="module")
def smooth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return soft_result(tmp_path_factory.mktemp("results") / "smooth", 1)


def material_of(path: Path) -> tuple[list[dict[str, Any]], int]:
    """The materials of a GLB file, and the channels of its base colour."""
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    mesh = trimesh.load(path, force="mesh")
    mode = next(iter(trimesh.load(path).geometry.values())).visual.material.baseColorTexture.mode
    assert len(mesh.faces) > 1000
    return tree["materials"], len(mode)


@pytest.mark.parametrize("back", ["open", "rounded"])
def test_a_soft_rim_fades_and_the_rest_stays_opaque(fur: Path, tmp_path: Path, back: str) -> None:
    given = ["--format", "glb", "--triangles", 4000, "--back", back]
    assert exported(fur, *given, "-o", tmp_path / "a.glb") == 0
    (core, rim), channels = material_of(tmp_path / "a.glb")
    assert "alphaMode" not in core and rim["alphaMode"] == "BLEND" and rim["doubleSided"]
    assert core["pbrMetallicRoughness"] == rim["pbrMetallicRoughness"] and channels == 4
    mesh = trimesh.load(tmp_path / "a.glb", force="mesh")
    pixel = 0.1 / 79
    assert mesh.extents[0] == pytest.approx(pixel * (2 * 0.99 * 40 + 0.46 * 14), abs=1.2 * pixel)


@pytest.mark.parametrize("back", ["open", "rounded"])
def test_an_outline_between_the_pixels_stays_opaque(
    smooth: Path, tmp_path: Path, back: str
) -> None:
    given = ["--format", "glb", "--back", back]
    assert exported(smooth, *given, "-o", tmp_path / "a.glb") == 0
    (material,), channels = material_of(tmp_path / "a.glb")
    assert "alphaMode" not in material and channels == 3
    mesh = trimesh.load(tmp_path / "a.glb", force="mesh")
    pixel = 0.1 / 79
    away = np.hypot(*(mesh.vertices - mesh.bounds.mean(0)).T[:2]) / pixel
    rim = np.sort(away)[-100:]
    assert np.sqrt(np.square(rim - 0.99 * 40).mean()) < 0.15


def test_a_soft_rim_in_other_formats(fur: Path, tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="needs the extra `usd`")
    for kind, file in (("obj", "a.obj"), ("usd", "b.usda")):
        assert exported(fur, "--format", kind, "-o", tmp_path / file) == 0
    assert "map_d a_alpha.png" in (tmp_path / "a.mtl").read_text()
    assert "inputs:opacity.connect" in (tmp_path / "b.usda").read_text()
    alpha = np.asarray(Image.open(tmp_path / "b_opacity.png"))
    assert alpha.ndim == 2 and (alpha[:, :60] == 255).all() and (alpha == 0).any()
    # Programs read the opacity of an OBJ from the grey value or from the alpha channel.
    assert (np.asarray(Image.open(tmp_path / "a_alpha.png")) == alpha[..., None]).all()


def test_blender_reads_the_opacity_of_an_obj(fur: Path, tmp_path: Path) -> None:
    bpy = pytest.importorskip("bpy", reason="needs the bpy module (extra `blender`)")
    assert exported(fur, "--format", "obj", "-o", tmp_path / "a.obj") == 0
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.ops.wm.obj_import(filepath=str(tmp_path / "a.obj")) == {"FINISHED"}
    tree = bpy.data.objects[0].data.materials[0].node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    link = shader.inputs["Alpha"].links[0]
    image = link.from_node.image
    values = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(values)
    channel = 3 if link.from_socket.name == "Alpha" else 0
    assert values[channel::4].min() == 0 and values[channel::4].max() == 1


@pytest.mark.parametrize("kind", ["fur", "smooth"])
def test_the_mesh_of_the_result_is_the_exported_one(
    kind: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    folder = request.getfixturevalue(kind)
    assert exported(folder, "--format", "glb", "-o", tmp_path / "a.glb") == 0
    assert (tmp_path / "a.glb").read_bytes() == (folder / "mesh.glb").read_bytes()
    told = json.loads((folder / "decomposition.json").read_text())["mesh"]
    assert told["faces"] == len(trimesh.load(folder / "mesh.glb", force="mesh").faces)


def test_vertices_of_arrays_are_pixels_where_the_outline_is_none(
    smooth: Path, tmp_path: Path
) -> None:
    """The same as those that `isc arrays` adds, and without a finer outline."""
    d, cover = load(smooth), read_cover(smooth / "mask.png", {})
    save(d, tmp_path / "a", arrays=True, cover=cover)
    save(d, tmp_path / "b", arrays=True)
    assert main(["arrays", str(smooth)]) == 0
    made, plain, added = (
        dict(np.load(folder / "arrays.npz")) for folder in (tmp_path / "a", tmp_path / "b", smooth)
    )
    assert made.keys() == added.keys() and all(
        np.array_equal(made[name], added[name], equal_nan=made[name].dtype != bool) for name in made
    )
    for name in ("vertices", "faces", "uv", "vertex_pixel", "origin"):
        assert np.array_equal(made[name], plain[name]), name
    column, row = made["origin"][:2]
    at = made["vertices"][:, :2] / made["metres_per_pixel"] * (1, -1) + (column, row)
    np.testing.assert_allclose(at[:, ::-1], made["vertex_pixel"], atol=1e-3)


def test_an_object_too_thin_for_an_outline_keeps_its_steps(tmp_path: Path) -> None:
    d = ball()
    thin = np.zeros_like(d.mask)
    thin[40:42, 35:95] = True
    cover = np.where(thin, 0.75, 0.0)
    maps = {name: np.where(thin[..., None], getattr(d, name), 0) for name in COLOR_MAPS}
    d = replace(d, mask=thin, height=np.where(thin, d.height, 0), brdf=None, **maps)
    save(d, tmp_path / "thin", cover=cover)
    assert len(trimesh.load(tmp_path / "thin" / "mesh.glb", force="mesh").faces) == 2 * 59


def test_arrays_have_the_cover(fur: Path) -> None:
    assert main(["arrays", str(fur)]) == 0
    arrays = dict(np.load(fur / "arrays.npz"))
    assert arrays["alpha"].shape == arrays["cover"].shape == arrays["soft"].shape
    assert arrays["alpha"].dtype == np.uint8 and arrays["soft"].dtype == bool


def test_from_a_photo_with_hair_to_a_mesh_that_fades(tmp_path: Path) -> None:
    """The soft alpha channel of a photo goes through the result into the mesh and the arrays."""
    d = ball()
    row, column = np.indices(d.mask.shape)
    away = np.hypot(row - 44, column - 66) - 0.99 * 40
    alpha = np.clip(0.5 - away / np.where(column > 66, 14, 1), 0, 1)
    color = np.where(d.mask[..., None], d.image / d.image.max(), 0.3)
    codes = np.rint(255 * np.dstack([color, alpha])).astype(np.uint8)
    Image.fromarray(codes).save(tmp_path / "hair.png")
    given = [tmp_path / "hair.png", "--model", "naive", "--arrays", "-o", tmp_path / "hair"]
    assert main(["decompose", *map(str, given)]) == 0
    arrays = dict(np.load(tmp_path / "hair" / "arrays.npz"))
    partly = (alpha > 0.1) & (alpha < 0.9) & (column > 70)
    assert np.abs(arrays["alpha"] / 255 - alpha)[partly].max() < 0.01
    path = tmp_path / "hair.glb"
    assert exported(tmp_path / "hair", "--format", "glb", "--back", "rounded", "-o", path) == 0
    assert [one.get("alphaMode") for one in material_of(path)[0]] == [None, "BLEND"]


@pytest.mark.slow
def test_files_of_the_object_s_part_are_those_of_the_whole_frame(tmp_path: Path) -> None:
    """Results of large frames store, and exports read, the object's part."""
    d = ball((400, 500), 20.0, (60.0, 85.0))
    cover = np.clip(0.5 + 0.99 * 20 - np.hypot(*(np.indices(d.mask.shape).T - (60, 85)).T), 0, 1)
    save(d, tmp_path / "whole", cover=cover)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps_file, "_LEAST_PIXELS", 100)
        save(d, tmp_path / "part", cover=cover)
    for name in ("part", "whole"):
        assert load_part(tmp_path / name).part.is_whole == (name == "whole")
        assert exported(tmp_path / name, "--format", "glb", "-o", tmp_path / f"{name}.glb") == 0
        textures = [
            "--textures",
            "generic",
            "--name",
            "x",
            "--roughness",
            0.5,
            "-o",
            tmp_path / f"{name}_textures",
        ]
        assert exported(tmp_path / name, *textures) == 0
        assert main(["arrays", str(tmp_path / name)]) == 0
    pairs = [(tmp_path / f"{name}.glb") for name in ("part", "whole")]
    assert pairs[0].read_bytes() == pairs[1].read_bytes()
    pairs = [(tmp_path / name / ARRAYS) for name in ("part", "whole")]
    assert pairs[0].read_bytes() == pairs[1].read_bytes()
    files = sorted(path.name for path in (tmp_path / "whole_textures").iterdir())
    assert len(files) > 3
    for file in files:
        one, other = (tmp_path / f"{name}_textures" / file for name in ("part", "whole"))
        assert one.read_bytes() == other.read_bytes(), file
