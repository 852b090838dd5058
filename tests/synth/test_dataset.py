"""Data sets on disk: the content of the files, continuing an interrupted run, and refusing other
people's folders.
"""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.datasets.highlight_set import load_rendered
from isc_core.errors import Cancelled, InputError
from isc_core.io.exr import read_channels
from isc_core.photo import read_photo
from isc_core.progress import Monitor, ProgressEvent
from isc_core.result_files.maps_file import LAYERS
from isc_core.shading.spherical_harmonics import real_sh
from synth.capture.recipe import PictureSettings, Recipe, photograph
from synth.capture.sensor import Sensor
from synth.dataset import generate as run_module
from synth.dataset.description import CONVENTIONS
from synth.dataset.generate import make_dataset, plan
from synth.dataset.reading import list_scenes, read_facts, read_truth
from synth.dataset.scene_folder import FILES
from synth.dataset.settings import DatasetSettings
from synth.dataset.splits import SPLITS, Choices
from synth.scene.materials import MODELS

pytestmark = pytest.mark.slow  # they share a run

# One scene of each split; shapes and lights that are quick to make.
CHOICES = Choices(
    shapes=("superquadric", "lathe"), albedos=("uniform", "patches"), lights=("directional", "sh")
)
PICTURE = PictureSettings(size=32, samples=4, renderer="arrays", sensor=Sensor(noise=0.01, bits=8))
RUN = DatasetSettings(5, 5, CHOICES, PICTURE)
COLOURS = ("image", "diffuse", "specular", "residual", "reflectance", "shading")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("synth") / "set"
    make_dataset(RUN, out)
    return out


@pytest.fixture
def root(made: Path, tmp_path: Path) -> Path:
    """A copy that a test may damage."""
    return Path(shutil.copytree(made, tmp_path / "set"))


def contents(root: Path) -> dict[str, bytes]:
    return {
        path.relative_to(root).as_posix(): path.read_bytes()
        for path in sorted(root.rglob("*"))
        if path.is_file()
    }


def test_the_folders_are_those_of_the_plan_and_hold_all_files(made: Path) -> None:
    planned = plan(RUN)
    assert {scene.split for scene in planned} == {"train", "test_materials", "test_lights", "test"}
    expected = {f"{s.split}/{s.recipe.name}/{name}" for s in planned for name in FILES} | {
        "manifest.json",
        "README.md",
    }
    assert set(contents(made)) == expected
    manifest = json.loads((made / "manifest.json").read_text())
    assert manifest["complete"] is True
    assert [scene["name"] for scene in manifest["scenes"]] == [
        scene.recipe.name for scene in planned
    ]
    assert len(list_scenes(made)) == 5
    assert [folder.parent.name for folder in list_scenes(made, "test_lights")] == ["test_lights"]


def test_maps_keep_their_identities(made: Path) -> None:
    for folder in list_scenes(made):
        channels = read_channels(folder / "maps.exr")
        assert set(channels) == {
            f"{layer}.{letter}" for layer, letters in LAYERS.items() for letter in letters
        }
        truth = read_truth(folder)
        inside, outside = truth.mask, ~truth.mask
        scale = truth.image[inside].max()
        layers = truth.diffuse + truth.specular + truth.residual
        assert np.abs(truth.image - layers)[inside].max() <= 1e-5 * scale
        assert (
            np.abs(truth.diffuse - truth.reflectance * truth.shading)[inside].max() <= 1e-5 * scale
        )
        assert np.abs(np.linalg.norm(truth.normal[inside], axis=-1) - 1).max() < 1e-5
        assert (truth.normal[outside] == (0, 0, 1)).all()
        assert not any(
            getattr(truth, name)[outside].any()
            for name in (*COLOURS, "height", "strength", "gloss")
        )
        assert truth.residual[inside].any(), "the sensor's noise is in the residual"
        assert (channels["confidence.Y"] == truth.mask).all()
        fitted = np.exp(real_sh(truth.normal[inside]) @ truth.illumination) - truth.shading[inside]
        misfit = np.sqrt(np.square(fitted).mean() / np.square(truth.shading[inside]).mean())
        assert misfit == pytest.approx(truth.light_fit_residual, rel=1e-3)


def test_scenes_are_read_as_they_were_rendered(made: Path) -> None:
    scene = plan(RUN)[0]
    _, truth = photograph(scene.recipe)
    found = read_truth(made / scene.split / scene.recipe.name)
    for name, values in truth.arrays().items():
        np.testing.assert_allclose(found.arrays()[name], values, rtol=1e-6, atol=0, err_msg=name)
    assert found.light_fit_residual == truth.light_fit_residual


def test_variance_of_the_diffuse_layer_is_that_of_its_shading(made: Path) -> None:
    for folder in list_scenes(made):
        variance, truth = read_channels(folder / "variance.exr"), read_truth(folder)
        diffuse = np.stack([variance[f"diffuse.{c}"] for c in "RGB"], -1)
        assert np.allclose(diffuse, truth.reflectance**2 * truth.shading_variance, rtol=1e-5)


def test_the_facts_are_those_of_the_recipe(made: Path) -> None:
    for scene in plan(RUN):
        recipe, folder = scene.recipe, made / scene.split / scene.recipe.name
        facts, truth = read_facts(folder), read_truth(folder)
        names = (
            recipe.name,
            scene.split,
            recipe.shape.name,
            recipe.material.name,
            recipe.light.name,
            recipe.seed,
        )
        assert names == (
            facts.name,
            facts.split,
            facts.object,
            facts.material,
            facts.light,
            facts.seed,
        )
        assert (facts.albedo, facts.model, facts.light_kind) == (
            recipe.albedo,
            recipe.model,
            recipe.light.family,
        )
        assert facts.mask_pixels == truth.mask.sum()
        parts = truth.specular[truth.mask].sum(), truth.diffuse[truth.mask].sum()
        assert facts.specular_share == pytest.approx(parts[0] / sum(parts), rel=1e-4)
        assert (facts.gloss_class == "diffuse") == (facts.specular_share == 0)


def test_the_photo_is_the_image_a_camera_stored(made: Path) -> None:
    for folder in list_scenes(made):
        photo, truth = read_photo(folder / "photo.png"), read_truth(folder)
        assert (photo.mask == truth.mask).all()
        assert np.abs(photo.image - truth.image)[truth.mask].max() < 1e-6, (
            "8-bit codes come back to the last bit"
        )


def test_separations_can_be_judged_on_it(made: Path) -> None:
    folder = list_scenes(made)[0]
    rendered, truth = load_rendered(folder), read_truth(folder)
    assert np.array_equal(rendered.image, truth.image) and np.array_equal(
        rendered.diffuse, truth.diffuse
    )
    assert np.array_equal(rendered.mask, truth.mask)


def test_the_description_records_settings_and_frame(made: Path) -> None:
    for scene in plan(RUN):
        content = json.loads((made / scene.split / scene.recipe.name / "scene.json").read_text())
        assert content["material"]["convention"] == CONVENTIONS[scene.recipe.model]
        camera = content["camera"]
        opencv, blender = (
            np.array(camera["world_to_camera"][name]) for name in ("opencv", "blender")
        )
        assert np.allclose(np.diag([1, -1, -1, 1]) @ blender, opencv)
        assert (
            camera["pixels_per_unit"] > 0
            and content["render"]["variant"]
            and content["versions"]["mitsuba"]
        )
        assert content["render"]["interreflection"] is False
    assert set(CONVENTIONS) == set(MODELS)


@pytest.mark.parametrize("perspective", [False, True])
def test_the_camera_of_the_description_puts_the_surface_where_the_picture_has_it(
    tmp_path: Path, perspective: bool
) -> None:
    """Heights, converted to space and projected by the OpenCV matrix, hit the centres of
    their pixels.
    """
    make_dataset(
        DatasetSettings(1, 5, CHOICES, replace(PICTURE, perspective=perspective)), tmp_path / "set"
    )
    folder = list_scenes(tmp_path / "set")[0]
    truth, camera = read_truth(folder), json.loads((folder / "scene.json").read_text())["camera"]
    rows, columns = np.nonzero(truth.mask)
    z = truth.height[truth.mask].astype(float) / camera["pixels_per_unit"]
    nearer = 1 - z / camera["distance"] if perspective else 1.0
    x = (columns + 0.5 - 16) / camera["pixels_per_unit"] * nearer
    y = (16 - rows - 0.5) / camera["pixels_per_unit"] * nearer
    seen = np.array(camera["world_to_camera"]["opencv"]) @ np.stack([x, y, z, np.ones_like(z)])
    scale = camera["focal_length"] / seen[2] if perspective else 32 / camera["view_width"]
    across, down = (seen[i] * scale + camera["principal_point"][i] for i in range(2))
    assert np.abs(across - columns - 0.5).max() < 1e-3 and np.abs(down - rows - 0.5).max() < 1e-3
    assert (seen[2] > 0).all()


def test_the_same_seed_gives_the_same_bytes(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if the renderer's kernels were released in between."""
    monkeypatch.setattr(run_module, "KERNELS_KEPT", 1)
    make_dataset(replace(RUN, count=2), tmp_path / "again")
    ours, theirs = contents(tmp_path / "again"), contents(made)
    scenes = [name for name in ours if name.endswith(("scene.json", "maps.exr"))]
    assert len(scenes) == 4
    assert all(ours[name] == theirs[name] for name in scenes)
    assert not any(str(tmp_path).encode() in content for content in ours.values()), (
        "no path is written"
    )


def test_an_interrupted_run_continues(
    root: Path, made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = list_scenes(root)
    shutil.rmtree(folders[0])
    maps = folders[1] / "maps.exr"
    maps.write_bytes(maps.read_bytes()[:-100])
    (folders[2] / "scene.json").write_text("{")
    (folders[3] / "photo.png").unlink()
    rendered = counted(monkeypatch)
    outcome = make_dataset(RUN, root)
    assert (outcome.made, outcome.kept) == (4, 1)
    assert folders[4].name not in rendered and len(rendered) == 4
    assert contents(root) == contents(made)
    assert make_dataset(RUN, root).made == 0


def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the scenes rendered from now on."""
    rendered: list[str] = []

    def noting(recipe: Recipe, monitor: Monitor) -> object:
        rendered.append(recipe.name)
        return photograph(recipe, monitor)

    monkeypatch.setattr(run_module, "photograph", noting)
    return rendered


def test_a_complete_set_is_not_written_again(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk or a kill then cannot make it an incomplete one."""
    before = contents(root)
    monkeypatch.setattr(run_module, "new_file", None)
    assert make_dataset(RUN, root).made == 0
    assert contents(root) == before


@pytest.mark.parametrize("steps", [1, 3, 6])
def test_cancelling_leaves_whole_scenes_only(made: Path, tmp_path: Path, steps: int) -> None:
    asked = iter(range(1000))
    with pytest.raises(Cancelled):
        make_dataset(
            replace(RUN, count=2), tmp_path / "set", Monitor(cancelled=lambda: next(asked) >= steps)
        )
    left, whole = contents(tmp_path / "set"), contents(made)
    for name in left:
        if "/" in name:
            assert left[name] == whole[name]
    assert not [path for path in tmp_path.rglob("*") if "partial" in path.name]
    if left:
        assert json.loads(left["manifest.json"])["complete"] is False


def test_progress_names_the_scene_and_never_goes_back(tmp_path: Path) -> None:
    seen: list[ProgressEvent] = []
    make_dataset(replace(RUN, count=2), tmp_path / "set", Monitor(seen.append))
    fractions = [event.fraction for event in seen]
    assert any(event.stage == "scene 1 of 2" for event in seen)
    assert any(event.stage == "scene 2 of 2" and event.detail.endswith(" left") for event in seen)
    assert fractions == sorted(fractions) and fractions[-1] <= 1


def test_a_longer_run_keeps_the_scenes_of_a_shorter_one(root: Path) -> None:
    outcome = make_dataset(replace(RUN, count=6), root)
    assert (outcome.made, outcome.kept) == (1, 5)
    assert len(list_scenes(root)) == 6
    with pytest.raises(InputError, match="run of 6 scenes"):
        make_dataset(RUN, root)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (replace(RUN, seed=6), "another run (seed 5, not 6)"),
        (replace(RUN, picture=replace(PICTURE, samples=8)), "another run (samples 4, not 8)"),
        (replace(RUN, picture=replace(PICTURE, sensor=Sensor())), "another run (sensor"),
        (
            replace(RUN, choices=replace(CHOICES, lights=("sh",))),
            "another run (lights directional, sh, not sh)",
        ),
    ],
)
def test_another_run_is_refused_and_nothing_touched(
    root: Path, other: DatasetSettings, message: str
) -> None:
    before = contents(root)
    with pytest.raises(InputError) as refused:
        make_dataset(other, root)
    assert message in str(refused.value)
    assert contents(root) == before


def test_foreign_folders_are_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.png").write_bytes(b"cat")
    (tmp_path / "text").write_text("a file")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "manifest.json").write_text('{"kind": "something else"}')
    before = contents(tmp_path)
    for name, message in {
        "photos": "not empty",
        "text": "is a file",
        "text/below": "not a folder|is a file",
        "other": "not a manifest",
    }.items():
        with pytest.raises(InputError, match=message):
            make_dataset(RUN, tmp_path / name)
    assert contents(tmp_path) == before


def test_a_scene_folder_with_a_foreign_file_is_kept(root: Path) -> None:
    folder = list_scenes(root)[0]
    (folder / "notes.txt").write_text("mine")
    (folder / "maps.exr").write_bytes(b"")
    with pytest.raises(InputError, match="notes.txt"):
        make_dataset(RUN, root)
    assert (folder / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize(("count", "seed"), [(0, 0), (-1, 0), (5, 99_999), (100_001, 0)])
def test_impossible_counts_are_refused(count: int, seed: int) -> None:
    with pytest.raises(InputError, match="not possible"):
        DatasetSettings(count, seed)


def test_scenes_of_schema_1_are_read_with_the_new_gloss_class(root: Path) -> None:
    path = list_scenes(root)[0] / "scene.json"
    content = json.loads(path.read_text())
    content["schema_version"], content["material"]["gloss_class"] = 1, "matt"
    path.write_text(json.dumps(content))
    assert read_facts(path.parent).gloss_class == "diffuse"


def test_reading_refuses_other_folders(root: Path, tmp_path: Path) -> None:
    folder = list_scenes(root)[0]
    with pytest.raises(InputError, match="not a data set"):
        list_scenes(tmp_path / "nowhere")
    with pytest.raises(InputError, match="unknown split 'dev'"):
        list_scenes(root, "dev")
    with pytest.raises(InputError, match="no finished scene of the split test_objects"):
        list_scenes(root, "test_objects")
    with pytest.raises(InputError, match="not a scene of isc synth"):
        read_facts(root)
    with pytest.raises(InputError, match="not a scene of isc synth"):
        read_truth(tmp_path)
    assert set(SPLITS) >= {read_facts(folder).split}


@pytest.mark.parametrize(
    "spoil",
    ["cut", "absent", "changed", "no json", "list", "newer", "foreign", "no light", "no checksum"],
)
def test_damaged_scenes_are_refused_in_one_line(root: Path, spoil: str) -> None:
    folder = list_scenes(root)[0]
    maps, text = folder / "maps.exr", folder / "scene.json"
    content = json.loads(text.read_text())
    if spoil == "cut":
        maps.write_bytes(maps.read_bytes()[:1000])
    elif spoil == "absent":
        (folder / "environment.exr").unlink()
    elif spoil == "changed":
        maps.write_bytes(maps.read_bytes()[:-1] + b"x")
    else:
        spoilt = {
            "no json": "{",
            "list": "[]",
            "newer": json.dumps({**content, "schema_version": 99}),
            "foreign": json.dumps({"kind": "x"}),
            "no light": json.dumps({**content, "illumination": {}}),
            "no checksum": json.dumps({**content, "files": {}}),
        }
        text.write_text(spoilt[spoil])
    with pytest.raises(InputError) as refused:
        read_truth(folder)
    assert str(folder) in str(refused.value) and "\n" not in str(refused.value)
