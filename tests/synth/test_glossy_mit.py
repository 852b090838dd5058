"""The glossy MIT-Berkeley set: the set's own diffuse layer, a physically correct specular layer,
files that the set's own readers read.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io

from isc_core.cli.interface.parser import Parser, add_general_options
from isc_core.datasets.highlight_set import load_laboratory
from isc_core.datasets.mit_berkeley import (
    INPUTS,
    list_objects,
    load_object,
    usual_illuminations,
)
from isc_core.errors import Cancelled, InputError
from isc_core.evaluation.metrics import truth_normal
from isc_core.io.exr import read_channels
from isc_core.progress import Monitor
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.environment_map import directions, resampled, shading_under, solid_angles
from isc_core.shading.spherical_harmonics import light_from_reference, real_sh
from synth.commands import glossy_mit
from synth.glossy_mit.files import LABORATORY_FILES, NATURAL_FILES
from synth.glossy_mit.generate import make_glossy
from synth.glossy_mit.gloss import environment_gloss, panel_layers
from synth.glossy_mit.layers import make_layers, surface_of
from synth.glossy_mit.settings import LIGHTS, GlossySettings, root_name, root_names
from synth.glossy_mit.source import Source, load_source
from synth.scene.lights import lights_as_environment, panel_toward_origin
from synth.scene.variant import load_mitsuba

pytestmark = pytest.mark.slow  # they share a run

VIEW = np.array([0.0, 0.0, 1.0])
OBJECT = "teabag2"
CODE = 1 / 65535


def facing(count: int, seed: int = 0) -> np.ndarray:
    normal = np.random.default_rng(seed).normal(size=(count, 3))
    normal[:, 2] = np.abs(normal[:, 2]) + 0.2
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def dataset(shared: Path) -> Path:
    return shared / "data" / "mit_berkeley_train"


@pytest.fixture(scope="module")
def made(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("glossy") / "out"
    make_glossy(dataset, out, GlossySettings(), [OBJECT])
    return out


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set of one bumpy object of 40 x 48 pixels, laid out as MIT-Berkeley's."""
    root = tmp_path_factory.mktemp("small")
    rng = np.random.default_rng(3)
    y, x = np.meshgrid(np.arange(40.0), np.arange(48.0), indexing="ij")
    inside = ((y - 20) / 17) ** 2 + ((x - 24) / 20) ** 2
    depth = np.where(
        inside < 1, 8 * np.sqrt(np.maximum(1.05 - inside, 0)) + 0.5 * np.sin(x / 3), np.nan
    )
    mask = (np.isfinite(depth) * 65535).astype(np.uint16)
    reflectance = (rng.uniform(0.2, 0.8, (40, 48, 3)) * 65535).astype(np.uint16)
    light = rng.normal(size=(9, 3)) * 0.2 - 0.3
    for name in ("laboratory", "natural"):
        folder = root / name / "bump"
        folder.mkdir(parents=True)
        for file in ("diffuse", "original", "reflectance", "shading_color"):
            cv2.imwrite(str(folder / f"{file}.png"), reflectance)
        cv2.imwrite(str(folder / "mask.png"), mask)
    laboratory = root / "laboratory" / "bump"
    scipy.io.savemat(laboratory / "Z.mat", {"depth": depth})
    scipy.io.savemat(
        laboratory / "crop_idx.mat", {"crop_idx1": np.arange(2, 40), "crop_idx2": np.arange(3, 46)}
    )
    scipy.io.savemat(laboratory / "L.mat", {"color_lights": {"diffuse": light}})
    scipy.io.savemat(
        laboratory / "shading_corrected_color.mat", {"shading_correct": np.ones((40, 48, 3))}
    )
    scipy.io.savemat(root / "natural" / "bump" / "L.mat", {"L": light[:, ::-1]})
    return root


@pytest.fixture(scope="module")
def bump(small: Path) -> Source:
    return load_source(small, "bump")


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


# --- the gloss ------------------------------------------------------------------------------------


@pytest.mark.parametrize("exponent", [10.0, 100.0, 1000.0])
def test_the_gloss_of_an_environment_is_the_integral_of_the_lobe(exponent: float) -> None:
    """Against `isc_core.shading.brdf`, summed over a finer environment without omissions."""
    sky = np.random.default_rng(1).gamma(1.0, size=(8, 16, 3))
    normal, rows = facing(6), 160
    toward, solid = directions(rows).reshape(-1, 3), solid_angles(rows).reshape(-1, 1)
    lobe = BlinnPhong(1.0, exponent).value(normal[:, None], VIEW, toward) * np.maximum(
        normal @ toward.T, 0
    )
    wanted = lobe @ (solid * resampled(sky, rows).reshape(-1, 3))
    np.testing.assert_allclose(
        environment_gloss(sky, normal, exponent), wanted, atol=4e-3 * wanted.max()
    )


def test_a_uniform_environment_seen_head_on_gives_the_lobes_energy() -> None:
    """Closed form of `shading.brdf.blinn_phong`: (p + 8) (p + 2^(-p/2)) / ((p + 2) (p + 4))."""
    for exponent in (9.0, 100.0):
        wanted = (
            (exponent + 8) * (exponent + 2 ** (-exponent / 2)) / ((exponent + 2) * (exponent + 4))
        )
        np.testing.assert_allclose(
            environment_gloss(np.ones((16, 32, 3)), VIEW[None], exponent), wanted, rtol=2e-3
        )


def test_a_panel_far_away_is_a_piece_of_an_environment() -> None:
    panel = panel_toward_origin((300.0, 400.0, 600.0), (300.0, 400.0), (1.0, 2.0, 3.0))
    normal = facing(200)
    shading, gloss = panel_layers(panel, np.zeros_like(normal), normal, 50.0)
    sky = lights_as_environment((panel,), 256)
    np.testing.assert_allclose(shading, shading_under(sky, normal), atol=0.01 * shading.max())
    np.testing.assert_allclose(gloss, environment_gloss(sky, normal, 50.0), atol=0.02 * gloss.max())


def test_the_gloss_equals_that_of_mitsuba(bump: Source) -> None:
    """A z-test at every pixel and channel, corrected for their number; an empty tracer removes
    shadows.
    """
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    from synth.rendering import RenderOptions, light_surface
    from synth.scene.lights import EnvironmentLight
    from synth.scene.materials import Material
    from synth.scene.meshes import Mesh
    from synth.scene.tracing import Tracer

    far = np.array([[0, 0, -1e5], [1e-3, 0, -1e5], [0, 1e-3, -1e5]])
    nothing = Tracer(Mesh(far, np.tile(VIEW, (3, 1)), np.zeros((3, 2)), np.array([[0, 1, 2]])))
    sky = resampled(np.random.default_rng(2).gamma(2.0, size=(8, 16, 3)), 32)
    surface = surface_of(bump, 40.0)
    material = Material(np.ones((1, 1, 3)), "blinn_phong", gloss=40.0, strength=1.0)
    lit = light_surface(
        surface, material, (EnvironmentLight(sky),), nothing, RenderOptions(samples=256, seed=5)
    )
    gloss = environment_gloss(sky, bump.normal, 40.0)
    z = (lit.specular - gloss) / np.sqrt(lit.specular_variance + (2e-3 * gloss.max()) ** 2)
    assert np.abs(z).max() < 5.5
    assert 0.5 < z.std() < 1.2
    np.testing.assert_allclose(
        lit.specular.sum(0), gloss.sum(0), atol=5 * np.sqrt(lit.specular_variance.sum(0).max())
    )


# --- the layers -----------------------------------------------------------------------------------


def test_the_surface_is_where_the_mesh_of_its_heights_is(bump: Source) -> None:
    from synth.shapes.height_field import place_height

    vertices = place_height(bump.height).mesh.vertices
    np.testing.assert_allclose(
        surface_of(bump, 10.0).position, vertices[: len(bump.normal)], atol=1e-12
    )


def test_shading_is_the_sets_own_and_a_panel_adds_to_both_layers(bump: Source) -> None:
    layers = make_layers(bump, GlossySettings(), Monitor())
    assert tuple(layers) == LIGHTS
    for name in ("natural", "laboratory"):
        own, with_panel = layers[name], layers[f"{name}-area"]
        np.testing.assert_allclose(
            own.shading, np.exp(real_sh(bump.normal) @ bump.lights[name]), rtol=1e-12
        )
        assert own.light_residual == 0 and own.panel is None and with_panel.panel is not None
        assert (with_panel.shading - own.shading).mean() == pytest.approx(0.75 * own.shading.mean())
        added = with_panel.gloss - own.gloss
        assert added.min() >= 0
        np.testing.assert_allclose(added, added[:, :1] * np.ones(3), atol=1e-9)
        assert added.max() > own.gloss.max()


# --- the files ------------------------------------------------------------------------------------


def pictures(root: Path, name: str = OBJECT) -> dict[str, np.ndarray]:
    folder = root / "laboratory" / name
    return {
        path.stem: cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]
        for path in folder.glob("*.png")
        if path.stem != "mask"
    }


def test_every_level_and_light_is_a_set_that_the_readers_read(made: Path, dataset: Path) -> None:
    theirs = load_object(dataset, OBJECT, "laboratory", "diffuse")
    for name in root_names(GlossySettings()):
        assert (
            list_objects(made / name, "laboratory")
            == list_objects(made / name, "natural")
            == (OBJECT,)
        )
        original, diffuse = (
            load_object(made / name, OBJECT, "laboratory", kind) for kind in ("original", "diffuse")
        )
        natural = load_object(made / name, OBJECT, "natural", "diffuse")
        assert original.mask.shape == theirs.mask.shape
        assert (original.mask <= theirs.mask).all()
        assert original.mask.sum() > 0.9 * theirs.mask.sum()
        for read in (original, diffuse, natural):
            np.testing.assert_array_equal(read.valid, original.mask)
            np.testing.assert_array_equal(
                read.reflectance[read.mask], theirs.reflectance[read.mask]
            )
            np.testing.assert_array_equal(read.height[read.mask], theirs.height[read.mask])
            assert np.isnan(read.height[~read.mask]).all()
        np.testing.assert_array_equal(natural.image, diffuse.image)
        np.testing.assert_allclose(natural.shading, diffuse.shading, atol=0.51 * CODE)
        np.testing.assert_allclose(natural.light, diffuse.light)


def test_the_frame_and_the_crop_are_the_sets_own(made: Path, dataset: Path) -> None:
    ours, theirs = (
        made / "level-25_natural" / "laboratory" / OBJECT,
        dataset / "laboratory" / OBJECT,
    )
    assert (ours / "crop_idx.mat").read_bytes() == (theirs / "crop_idx.mat").read_bytes()
    for file in (path.name for path in ours.glob("*.png")):
        shape, wanted = (
            cv2.imread(str(folder / file), cv2.IMREAD_UNCHANGED).shape for folder in (ours, theirs)
        )
        assert shape == wanted, file
    assert (
        scipy.io.loadmat(ours / "Z.mat")["depth"].shape
        == scipy.io.loadmat(theirs / "Z.mat")["depth"].shape
    )


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("level", [10, 25, 50])
def test_layers_add_up_and_have_the_requested_share(made: Path, level: float, light: str) -> None:
    found = pictures(made / root_name(level, light))
    original, diffuse, specular = (
        found[name].astype(int) for name in ("original", "diffuse", "specular")
    )
    np.testing.assert_array_equal(original, diffuse + specular)
    assert specular.sum() / original.sum() == pytest.approx(level / 100, rel=0.01)
    assert original.max() < 65535
    truth = load_object(made / root_name(level, light), OBJECT, "laboratory", "diffuse")
    product = truth.reflectance * truth.shading
    np.testing.assert_allclose(truth.image[truth.mask], product[truth.mask], atol=1.01 * CODE)
    channels = read_channels(
        made / root_name(level, light) / "laboratory" / OBJECT / "specular.exr"
    )
    exact = np.stack([channels[name] for name in "RGB"], -1)
    np.testing.assert_allclose(specular * CODE, exact, atol=0.51 * CODE)


@pytest.mark.parametrize("illumination", ["natural", "laboratory"])
def test_shading_is_that_of_the_light_in_the_file(
    made: Path, dataset: Path, illumination: str
) -> None:
    theirs = load_object(dataset, OBJECT, illumination, "diffuse")
    ours = load_object(made / root_name(50, illumination), OBJECT, "laboratory", "diffuse")
    normal = truth_normal(theirs.height)[ours.mask]
    np.testing.assert_allclose(
        ours.shading[ours.mask],
        np.exp(real_sh(normal) @ light_from_reference(ours.light)),
        rtol=1e-5,
    )
    gain = ours.shading[ours.mask] / np.exp(real_sh(normal) @ light_from_reference(theirs.light))
    np.testing.assert_allclose(gain, gain.mean(), rtol=1e-5)
    if illumination == "natural":
        lit = theirs.image[ours.mask] / ours.image[ours.mask] * gain.mean()
        assert np.quantile(np.abs(lit - 1), 0.99) < 0.02


def test_levels_differ_in_the_specular_layer_only(made: Path) -> None:
    low, high = (
        contents(made / root_name(level, "natural-area") / "laboratory" / OBJECT)
        for level in (10, 50)
    )
    assert {name for name in low if low[name] != high[name]} == {
        "original.png",
        "specular.png",
        "specular.exr",
        "object.json",
    }


def test_separations_are_measured_on_it(made: Path) -> None:
    truth = load_laboratory(made / "level-25_laboratory-area", OBJECT)
    np.testing.assert_allclose(truth.image, truth.diffuse + truth.specular, atol=1e-6)
    assert not truth.clipped.any()


def test_the_card_describes_the_set_and_the_record_its_measurements(made: Path) -> None:
    for name in root_names(GlossySettings()):
        text = (made / name / "README.md").read_text(encoding="utf-8")
        assert "do not redistribute" in text and "isc synth glossy-mit ROOT" in text
        scene = json.loads((made / name / "scene.json").read_text(encoding="utf-8"))
        record = scene["objects"][OBJECT]
        assert record["specular_share"] == pytest.approx(scene["level"] / 100, rel=1e-6)
        assert record["clipped_share"] == 0
        assert 0 < record["environment_fit_residual"] < 0.1
        assert (record["light_fit_residual"] > 0) == ("area" in scene["light"])
        assert {"isc", "numpy", "mitsuba"} <= set(scene["versions"])
        assert set(record["files"]) == set(LABORATORY_FILES[1:])


# --- runs -----------------------------------------------------------------------------------------


def stopping_after(count: int) -> Monitor:
    calls: Iterator[int] = iter(range(1000))
    return Monitor(cancelled=lambda: next(calls) >= count)


def test_equal_seeds_give_equal_files_and_others_other_panels(small: Path, tmp_path: Path) -> None:
    settings = {"levels": (25.0,)}
    for name, seed in (("a", 4), ("b", 4), ("c", 5)):
        make_glossy(small, tmp_path / name, GlossySettings(**settings, seed=seed))
    a, b, c = (contents(tmp_path / name) for name in "abc")
    assert a == b
    png = "laboratory/bump/original.png"
    assert a[f"level-25_natural/{png}"] == c[f"level-25_natural/{png}"]
    assert a[f"level-25_natural-area/{png}"] != c[f"level-25_natural-area/{png}"]


def test_an_interrupted_run_continues_and_a_finished_one_is_unchanged(
    small: Path, tmp_path: Path
) -> None:
    settings = GlossySettings(levels=(50.0,))
    make_glossy(small, tmp_path / "whole", settings)
    with pytest.raises(Cancelled):
        make_glossy(small, tmp_path / "cut", settings, monitor=stopping_after(6))
    found = contents(tmp_path / "cut")
    assert "run.json" in found and len(found) < len(contents(tmp_path / "whole"))
    assert not [name for name in found if "partial" in name]
    assert make_glossy(small, tmp_path / "cut", settings).made == 1
    assert contents(tmp_path / "cut") == contents(tmp_path / "whole")
    lately = (
        (tmp_path / "cut" / "level-50_natural" / "laboratory" / "bump" / "original.png")
        .stat()
        .st_mtime_ns
    )
    again = make_glossy(small, tmp_path / "cut", settings)
    assert (again.made, again.kept) == (0, 1)
    assert (
        tmp_path / "cut" / "level-50_natural" / "laboratory" / "bump" / "original.png"
    ).stat().st_mtime_ns == lately


def test_the_physical_variant_is_separate_and_has_shadows(small: Path, tmp_path: Path) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    settings = GlossySettings(levels=(25.0,), samples=16, physical=True)
    make_glossy(small, tmp_path / "out", GlossySettings(levels=(25.0,), samples=16))
    plain = contents(tmp_path / "out" / "level-25_natural" / "laboratory")
    outcome = make_glossy(small, tmp_path / "out", settings)
    assert outcome.made == 1 and "physical/level-25_natural" in outcome.roots
    assert contents(tmp_path / "out" / "level-25_natural" / "laboratory") == plain
    scene = json.loads(
        (tmp_path / "out" / "physical" / "level-25_natural" / "scene.json").read_text(
            encoding="utf-8"
        )
    )
    record = scene["objects"]["bump"]
    assert scene["physical"] and record["gloss_noise"] > 0
    assert record["variant"] == load_mitsuba().variant()
    assert record["specular_share"] == pytest.approx(0.25, rel=1e-6)
    exact, shadowed = (
        load_object(tmp_path / "out" / p / "level-25_natural", "bump", "laboratory", "original")
        for p in (".", "physical")
    )
    ratio = (shadowed.shading / exact.shading.clip(1e-9))[exact.mask]
    assert ratio.std() > 0.01
    product = shadowed.reflectance * shadowed.shading
    diffuse = load_object(
        tmp_path / "out" / "physical" / "level-25_natural", "bump", "laboratory", "diffuse"
    )
    np.testing.assert_allclose(diffuse.image[exact.mask], product[exact.mask], atol=1.01 * CODE)


# --- bad input ------------------------------------------------------------------------------------


def test_foreign_folders_are_not_changed(small: Path, tmp_path: Path) -> None:
    settings = GlossySettings(levels=(25.0,))
    foreign, file = tmp_path / "foreign", tmp_path / "file"
    foreign.mkdir()
    (foreign / "thesis.tex").write_text("mine")
    file.write_text("mine")
    for out, words in ((foreign, "not empty"), (file, "is a file")):
        with pytest.raises(InputError, match=words):
            make_glossy(small, out, settings)
    make_glossy(small, tmp_path / "out", settings)
    before = contents(tmp_path / "out")
    for other in (
        GlossySettings(levels=(25.0,), seed=1),
        GlossySettings(levels=(30.0,)),
        GlossySettings(levels=(25.0,), exponent=20.0),
    ):
        with pytest.raises(InputError, match="contains another run"):
            make_glossy(small, tmp_path / "out", other)
    assert contents(tmp_path / "out") == before
    assert contents(foreign) == {"thesis.tex": b"mine"}


def test_nothing_is_written_into_the_data_set(small: Path) -> None:
    before = contents(small)
    for out in (small, small / "glossy", small / "natural" / ".." / "glossy"):
        with pytest.raises(InputError, match="inside the data set"):
            make_glossy(small, out, GlossySettings())
    assert contents(small) == before


def test_what_is_missing_is_named(small: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown object 'nut': choose from bump"):
        make_glossy(small, tmp_path / "out", GlossySettings(), ["bump", "nut"])
    with pytest.raises(InputError, match="no folder natural"):
        make_glossy(
            _copy(small, tmp_path / "half", "laboratory"), tmp_path / "out", GlossySettings()
        )
    broken = _copy(small, tmp_path / "broken", "laboratory", "natural")
    (broken / "laboratory" / "bump" / "Z.mat").unlink()
    with pytest.raises(InputError, match="Z.mat"):
        make_glossy(broken, tmp_path / "out2", GlossySettings())


def test_heights_that_are_nowhere_known_are_refused(small: Path, tmp_path: Path) -> None:
    flat = _copy(small, tmp_path / "flat", "laboratory", "natural")
    scipy.io.savemat(flat / "laboratory" / "bump" / "Z.mat", {"depth": np.full((40, 48), np.nan)})
    with pytest.raises(InputError, match="bump: no pixel of its mask has a known height"):
        make_glossy(flat, tmp_path / "out", GlossySettings())


def _copy(root: Path, to: Path, *folders: str) -> Path:
    for folder in folders:
        for path in (root / folder / "bump").iterdir():
            (to / folder / "bump").mkdir(parents=True, exist_ok=True)
            (to / folder / "bump" / path.name).write_bytes(path.read_bytes())
    return to


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"levels": ()}, "levels"),
        ({"levels": (10.0, 10.0)}, "different"),
        ({"levels": (100.0,)}, "below 100"),
        ({"levels": (float("nan"),)}, "below 100"),
        ({"samples": 1}, "samples"),
        ({"seed": -1}, "seed"),
        ({"exponent": 0.5}, "exponent"),
    ],
)
def test_impossible_settings_are_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        GlossySettings(**change)


def parsed(*words: str) -> argparse.Namespace:
    parser = Parser(prog="isc synth")
    command = parser.add_subparsers(required=True).add_parser("glossy-mit")
    glossy_mit.declare(command)
    add_general_options(command)
    return parser.parse_args(["glossy-mit", *words])


def test_the_command_makes_the_sets_and_prints_how_to_evaluate_on_them(
    small: Path, tmp_path: Path
) -> None:
    options = parsed(
        str(small),
        "-o",
        str(tmp_path / "out"),
        "--levels",
        "20",
        "--objects",
        "bump",
        "--seed",
        "3",
        "--exponent",
        "60",
    )
    lines = options.run(options, Monitor())
    assert len(lines) == 1 and "isc evaluate" in lines[0] and "level-20_natural" in lines[0]
    for light in LIGHTS:
        for kind in INPUTS:
            own = usual_illuminations(tmp_path / "out" / f"level-20_{light}", kind)
            assert own == (light.removesuffix("-area"),)
    made = tmp_path / "out" / "level-20_laboratory-area"
    assert {path.name for path in (made / "laboratory" / "bump").iterdir()} == set(LABORATORY_FILES)
    assert {path.name for path in (made / "natural" / "bump").iterdir()} == set(NATURAL_FILES)
    assert not parsed(str(small), "-o", "x", "--quiet").physical


def test_levels_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(InputError, match="percentages"):
        parsed("ROOT", "-o", "x", "--levels", "10,lots")
