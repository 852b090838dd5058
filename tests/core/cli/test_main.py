"""The command `isc`: what it writes, what it prints, and how it ends when it is cancelled."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from PIL import Image

from isc_core import __version__
from isc_core.cli.commands import build_parser
from isc_core.cli.interface.interrupts import Interrupts
from isc_core.cli.interface.terminal import ProgressBar
from isc_core.cli.main import main
from isc_core.datasets.mit_berkeley import load_object
from isc_core.errors import Cancelled, InputError
from isc_core.evaluation.runner import RunnerOptions, make_runner
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.io.exr import read_channels, write_channels
from isc_core.numerics.kernel_library import shipped_library
from isc_core.photo import read_photo
from isc_core.prior_fitting.absolute_color import TableFitOptions
from isc_core.prior_fitting.fit import FitOptions
from isc_core.progress import Monitor, ProgressEvent
from isc_core.result_files.known_inputs import CODE, read_height, read_light
from isc_core.result_files.result_folder import load
from isc_core.separation import BEST, separate
from isc_core.sirfs.priors.prior_file import load_prior_set, shipped_prior_set
from tests.core.ball_scene import LIGHT
from tests.core.command_line import (
    ROOT,
    ball_codes,
    ball_photo,
    isc_command,
    run_isc,
    through_terminal,
    write_image,
)
from tests.core.separation.scenes import glossy_disc

COMMANDS = ("decompose", "separate", "mask", "evaluate", "fit-priors")


def isc(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


# --- help -----------------------------------------------------------------------------------------


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert isc("--version") == 0
    assert capsys.readouterr().out == f"isc {__version__}\n"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(
    capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert isc(command, "--help") == 0
    text = capsys.readouterr().out
    assert f"  isc {command} " in text.partition("examples:")[2]
    assert all(len(line) <= 140 for line in text.splitlines())


@pytest.mark.parametrize(
    ("words", "place"),
    [
        ("decompose cup.png -o cup", "isc decompose"),
        ("edit cup relight -o cup", "isc edit RESULT relight"),
    ],
)
def test_an_unknown_option_refers_to_the_help_of_its_command(
    capsys: pytest.CaptureFixture[str], words: str, place: str
) -> None:
    assert isc(*words.split(), "--unknown") == 2
    error = capsys.readouterr().err
    assert error == f"isc: error: unrecognized arguments: --unknown (see `{place} --help`)\n"


@pytest.mark.slow
def test_the_examples_in_the_help_are_commands(capsys: pytest.CaptureFixture[str]) -> None:
    """An example whose options no longer exist would not parse."""
    found = []
    for words in ((), *((command,) for command in COMMANDS)):
        isc(*words, "--help")
        found += re.findall(
            r"^  isc (\S+ \S.*?)(?:  .*)?$", capsys.readouterr().out.partition("examples:")[2], re.M
        )
    assert len(found) >= 10
    parser = build_parser()
    for example in found:
        assert callable(parser.parse_args(example.split()).run), example


def test_the_modules_name_runs_the_command() -> None:
    done = run_isc("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"isc {__version__}\n", "")


# --- decompose ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A decomposition of the ball by the default model."""
    folder = tmp_path_factory.mktemp("ball")
    assert isc("decompose", ball_photo(folder), "--quiet", "-o", folder / "result") == 0
    return folder


def test_decompose_writes_a_whole_result(result: Path) -> None:
    found = load(result / "result")
    assert found.identity_errors().broken() == ()
    assert found.mask.shape == ball_codes().shape[:2]
    assert (
        found.provenance.settings["model"] == "joint"
        and found.provenance.settings["separator"] == BEST
    )
    assert found.provenance.input["name"] == "ball.png"
    assert {"maps.exr", "decomposition.json", "mesh.glb", "preview.png"} <= {
        entry.name for entry in (result / "result").iterdir()
    }
    assert sorted(entry.name for entry in result.iterdir()) == ["ball.png", "result"]


@pytest.mark.slow
def test_decompose_passes_the_reference_check(result: Path, shared: Path) -> None:
    checker = shared / "tools" / "check_result.py"
    done = subprocess.run(
        [sys.executable, str(checker), str(result / "result")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_options_reach_the_result(tmp_path: Path) -> None:
    options = [
        "--model",
        "sirfs",
        "--illumination",
        "laboratory",
        "--max-size",
        "30",
        "--seed",
        "5",
        "--threads",
        "1",
        "--engine",
        "numba",
    ]
    assert (
        isc(
            "decompose",
            ball_photo(tmp_path),
            *options,
            "--transfer",
            "linear",
            "--quiet",
            "-o",
            tmp_path / "out",
        )
        == 0
    )
    p = load(tmp_path / "out").provenance
    expected = {
        "model": "sirfs",
        "illumination": "laboratory",
        "max_size": 30,
        "threads": 1,
        "engine": "numba",
    }
    assert {name: p.settings[name] for name in expected} == expected
    assert p.seed == 5
    assert p.input["transfer"] == "linear"
    assert max(p.input["crop_box"][2:]) <= 30


@pytest.mark.slow
def test_the_same_command_gives_the_same_bytes_on_any_number_of_threads(
    result: Path, tmp_path: Path
) -> None:
    assert (
        isc("decompose", result / "ball.png", "--threads", "1", "--quiet", "-o", tmp_path / "again")
        == 0
    )
    assert (tmp_path / "again" / "maps.exr").read_bytes() == (
        result / "result" / "maps.exr"
    ).read_bytes()


@pytest.mark.slow
def test_an_earlier_result_is_replaced(tmp_path: Path) -> None:
    photo = ball_photo(tmp_path)
    for model in ("naive", "retinex"):
        assert isc("decompose", photo, "--model", model, "--quiet", "-o", tmp_path / "out") == 0
        assert load(tmp_path / "out").provenance.settings["model"] == model


def test_what_is_printed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    photo, out = ball_photo(tmp_path), tmp_path / "out"
    assert isc("decompose", photo, "--model", "naive", "-o", out) == 0
    printed = capfd.readouterr()
    assert printed.out == f"see {out / 'preview.png'}\n"
    assert all(line.startswith("isc: ") for line in printed.err.splitlines())
    assert "isc: building the mesh" in printed.err.splitlines()
    assert isc("decompose", photo, "--model", "naive", "--quiet", "-o", out) == 0
    printed = capfd.readouterr()
    assert (printed.out, printed.err) == ("", "")


@pytest.mark.parametrize(
    ("size", "remedy"), [("0", "as in the photo"), ("24", "use --max-size 0 for more")]
)
def test_relief_finer_than_the_maps_is_not_promised(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], size: str, remedy: str
) -> None:
    photo, finest = ball_photo(tmp_path), ("--detail", "2048", "--max-size", size)
    assert isc("decompose", photo, "--model", "naive", *finest, "-o", tmp_path / "out") == 0
    assert remedy in capfd.readouterr().out


# --- known inputs ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_known_shape_and_a_known_light_are_kept(tmp_path: Path) -> None:
    photo = ball_photo(tmp_path)
    mask = read_photo(photo).mask
    rows, columns = np.indices(mask.shape)
    height = np.sqrt(np.maximum(20.0**2 - (rows - 26) ** 2 - (columns - 29) ** 2, 0))
    write_channels(tmp_path / "shape.exr", {"Z": np.where(mask, height, np.nan)})
    (tmp_path / "light.json").write_text(json.dumps({"coefficients": LIGHT.tolist()}))
    known = ["--shape", tmp_path / "shape.exr", "--light", tmp_path / "light.json"]
    assert (
        isc("decompose", photo, "--model", "sirfs", *known, "--quiet", "-o", tmp_path / "out") == 0
    )
    found = load(tmp_path / "out")
    np.testing.assert_allclose(found.illumination, LIGHT, atol=1e-9)
    np.testing.assert_allclose(found.height[mask], (height - height[mask].min())[mask], atol=1e-4)


@pytest.mark.slow
def test_a_known_shape_is_extended_beyond_its_rim(tmp_path: Path) -> None:
    """Nothing outside the mask is read: on a slanted plane even the normals at the rim are the
    plane's.
    """
    photo = ball_photo(tmp_path)
    mask = read_photo(photo).mask
    rows, columns = np.indices(mask.shape)
    np.save(tmp_path / "plane.npy", np.where(mask, 0.5 * columns - 0.25 * rows, -1000.0))
    assert (
        isc(
            "decompose",
            photo,
            "--model",
            "sirfs",
            "--shape",
            tmp_path / "plane.npy",
            "--quiet",
            "-o",
            tmp_path / "out",
        )
        == 0
    )
    expected = np.array([-0.5, -0.25, 1.0]) / np.linalg.norm([-0.5, -0.25, 1.0])
    np.testing.assert_allclose(
        load(tmp_path / "out").normal[mask],
        np.broadcast_to(expected, (int(mask.sum()), 3)),
        atol=0.02,
    )


@pytest.mark.slow
def test_the_result_of_a_run_is_a_known_shape_for_the_next(result: Path, tmp_path: Path) -> None:
    folder = result / "result"
    assert (
        isc(
            "decompose",
            result / "ball.png",
            "--shape",
            folder,
            "--light",
            folder,
            "--quiet",
            "-o",
            tmp_path / "out",
        )
        == 0
    )
    before, after = load(folder), load(tmp_path / "out")
    np.testing.assert_array_equal(after.height, before.height)
    np.testing.assert_allclose(after.illumination, before.illumination, atol=1e-9)


def test_a_depth_beside_an_exact_shape_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo = ball_photo(tmp_path)
    np.save(tmp_path / "flat.npy", np.zeros(ball_codes().shape[:2]))
    flat = tmp_path / "flat.npy"
    known = ("--max-size", 16, "--shape", flat, "--depth", flat)
    assert isc("decompose", photo, *known, "-o", tmp_path / "out") == 2
    assert "give --shape or --depth, not both" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_result_records_what_was_known(tmp_path: Path) -> None:
    photo, first = ball_photo(tmp_path), tmp_path / "first"
    small = ("decompose", photo, "--quiet", "--max-size", 16)
    assert isc(*small, "--model", "retinex", "-o", first) == 0
    known = ("--light", first, "--depth", first, "--depth-sigma", 3)
    assert isc(*small, "--model", "sirfs", *known, "-o", tmp_path / "out") == 0
    assert not {"known", "depth_sigma"} & load(first).provenance.input.keys()
    recorded = load(tmp_path / "out").provenance.input
    assert recorded["known"] == ["light", "depth"]
    assert (recorded["depth_sigma"], recorded["depth_weight"]) == (3.0, 10.0)


@pytest.mark.parametrize("size", [20, 30])
def test_a_result_of_smaller_maps_is_a_known_shape(tmp_path: Path, size: int) -> None:
    photo, folder = ball_photo(tmp_path), tmp_path / "first"
    quiet = ("--model", "sirfs", "--quiet", "--max-size")
    small = ("decompose", photo, "--model", "retinex", "--quiet", "--max-size", 20)
    assert isc(*small, "-o", folder) == 0
    assert isc("decompose", photo, *quiet, size, "--shape", folder, "-o", tmp_path / "out") == 0
    before, after = load(folder), load(tmp_path / "out")
    scale = after.provenance.input["scale"] / before.provenance.input["scale"]
    assert scale == pytest.approx(size / 20, rel=0.02)
    assert after.height.max() == pytest.approx(scale * before.height.max(), rel=0.1)
    if scale == 1:
        error = np.abs(after.height - before.height)[before.mask]
        assert error.mean() < 0.02 * before.height.max()


@pytest.mark.slow
def test_a_measured_depth_bends_the_shape_towards_it(result: Path, tmp_path: Path) -> None:
    mask = load(result / "result").mask
    rows, columns = np.indices(mask.shape)
    tilted = np.where(mask & (rows % 5 > 0), 0.6 * columns, np.nan)
    np.save(tmp_path / "depth.npy", tilted)
    options = ["--depth", tmp_path / "depth.npy", "--depth-sigma", "1", "--depth-weight", "1000"]
    assert isc("decompose", result / "ball.png", *options, "--quiet", "-o", tmp_path / "out") == 0

    def misfit(folder: Path) -> float:
        difference = (load(folder).height - 0.6 * columns)[mask]
        return float(np.abs(difference - np.median(difference)).mean())

    assert misfit(tmp_path / "out") < 0.3 * misfit(result / "result")


@pytest.mark.parametrize("kind", ["exr", "layered exr", "npy", "png", "tiff"])
def test_a_height_map_means_the_same_in_every_format(tmp_path: Path, kind: str) -> None:
    codes = np.random.default_rng(1).integers(1, 65536, (12, 9)).astype(np.uint16)
    height = codes * CODE
    codes[3, 4], height[3, 4] = 0, np.nan
    path = tmp_path / f"map.{kind.rpartition(' ')[2]}"
    match kind:
        case "exr":
            write_channels(path, {"Y": height})
        case "layered exr":
            write_channels(path, {"height.Z": height, "normal.Z": np.ones((12, 9))})
        case "npy":
            np.save(path, height)
        case _:
            write_image(path, codes)
    np.testing.assert_array_equal(read_height(path, (12, 9)), height)


def test_the_height_scale_is_the_unit(tmp_path: Path) -> None:
    np.save(tmp_path / "distance.npy", np.array([[1, 2], [3, 4]]))
    np.testing.assert_array_equal(
        read_height(tmp_path / "distance.npy", (2, 2), -0.5), [[-0.5, -1.0], [-1.5, -2.0]]
    )
    write_image(tmp_path / "codes.png", np.arange(64 * 64, dtype=np.uint16).reshape(64, 64))
    assert read_height(tmp_path / "codes.png", (64, 64), 2.0)[0, 3] == 6.0


def test_a_height_map_that_cannot_be_chosen(tmp_path: Path) -> None:
    write_channels(tmp_path / "two.exr", {"R": np.ones((4, 4)), "G": np.ones((4, 4))})
    with pytest.raises(InputError, match="no channel Y, Z or height.Z, only G, R"):
        read_height(tmp_path / "two.exr", (4, 4))


@pytest.mark.parametrize("shape", ["plain", "coefficients", "decomposition"])
def test_a_light_is_read_from_common_files(tmp_path: Path, shape: str) -> None:
    plain = LIGHT.tolist()
    forms = {
        "plain": plain,
        "coefficients": {"coefficients": plain},
        "decomposition": {"illumination": {"coefficients": plain}},
    }
    (tmp_path / "decomposition.json").write_text(json.dumps(forms[shape]))
    np.testing.assert_array_equal(read_light(tmp_path / "decomposition.json"), LIGHT)
    np.testing.assert_array_equal(read_light(tmp_path), LIGHT)


# --- the other commands ---------------------------------------------------------------------------


def disc_photo(folder: Path) -> Path:
    """A disc of three strong albedos with three highlights, a 16-bit PNG; nothing is clipped."""
    return write_image(
        folder / "disc.png",
        np.rint(65535 * np.clip(linear_to_srgb(0.7 * glossy_disc()[0]), 0, 1)).astype(np.uint16),
    )


def layer(maps: dict[str, np.ndarray], name: str) -> np.ndarray:
    return np.stack([maps[f"{name}.{c}"] for c in "RGB"], -1)


def test_separate_adds_up(tmp_path: Path) -> None:
    assert isc("separate", disc_photo(tmp_path), "--quiet", "-o", tmp_path / "out") == 0
    maps = read_channels(tmp_path / "out" / "separation.exr")
    layers = np.sum([layer(maps, name) for name in ("diffuse", "specular", "residual")], axis=0)
    photo = read_photo(tmp_path / "disc.png")
    np.testing.assert_allclose(layers[photo.mask], photo.image[photo.mask], atol=1e-5)
    image, diffuse, _ = glossy_disc()
    truth, found = 0.7 * (image - diffuse).sum(), layer(maps, "specular").sum()
    assert 0.8 * truth < found < 1.1 * truth


def test_separate_uses_the_best_method_by_default(tmp_path: Path) -> None:
    photo = disc_photo(tmp_path)
    for folder, words in (
        ("usual", ()),
        ("best", ("--method", BEST)),
        ("other", ("--method", "none")),
    ):
        assert isc("separate", photo, *words, "--quiet", "-o", tmp_path / folder) == 0
    usual, best, other = (
        layer(read_channels(tmp_path / name / "separation.exr"), "specular")
        for name in ("usual", "best", "other")
    )
    assert np.array_equal(usual, best) and usual.max() > 0.2 and not other.any()


def grey_ball(folder: Path) -> Path:
    return write_image(
        folder / "grey.png",
        np.repeat(ball_codes().mean(axis=-1, keepdims=True), 3, axis=-1).astype(np.uint16),
    )


def test_grey_photos_are_separated_into_themselves(tmp_path: Path) -> None:
    photo = grey_ball(tmp_path)
    assert isc("separate", photo, "--quiet", "-o", tmp_path / "out") == 0
    maps, original = read_channels(tmp_path / "out" / "separation.exr"), read_photo(photo)
    np.testing.assert_allclose(
        layer(maps, "diffuse")[original.mask], original.image[original.mask], atol=1e-6
    )
    assert not layer(maps, "specular")[~original.clipped].any()


def test_an_unchanged_photo_is_noted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert isc("separate", grey_ball(tmp_path), "-o", tmp_path / "grey") == 0
    assert "the photo has no colour" in capsys.readouterr().out
    level = np.linspace(0.5, 1, len(ball_codes()))[:, None, None]
    dull = level * np.where(ball_codes().any(axis=-1, keepdims=True), [9000, 9000, 8000], 0)
    photo = write_image(tmp_path / "dull.png", dull.astype(np.uint16))
    assert isc("separate", photo, "--method", "network", "-o", tmp_path / "dull") == 0
    assert "none stands out to the network" in capsys.readouterr().out
    assert isc("separate", ball_photo(tmp_path), "--method", "none", "-o", tmp_path / "same") == 0
    assert "no highlight was found" not in capsys.readouterr().out


@pytest.mark.slow
def test_grey_photos_are_decomposed(tmp_path: Path) -> None:
    photo = grey_ball(tmp_path)
    assert isc("decompose", photo, "--quiet", "-o", tmp_path / "joint") == 0
    assert load(tmp_path / "joint").identity_errors().broken() == ()
    assert (
        isc("decompose", photo, "--model", "mdr", "--quiet", "-o", tmp_path / "out") == 0
    )  # by colour alone, and there is none
    found = load(tmp_path / "out")
    assert found.identity_errors().broken() == ()
    unclipped = found.mask & ~read_photo(photo).clipped
    assert not found.specular[unclipped].any() and found.confidence[found.mask].max() < 1


@pytest.mark.slow
def test_a_prior_restricts_highlights(tmp_path: Path) -> None:
    """Black: nowhere; middle grey: unknown; the left half black: only on the right."""
    photo = disc_photo(tmp_path)
    half = np.full((96, 120), 32768, np.uint16)
    priors = {
        "black": 0 * half,
        "middle": half,
        "right": np.where(np.arange(120) < 60, 0, half).astype(np.uint16),
    }
    assert isc("separate", photo, "--quiet", "-o", tmp_path / "usual") == 0
    for name, codes in priors.items():
        prior = write_image(tmp_path / f"{name}.png", codes)
        assert isc("separate", photo, "--prior", prior, "--quiet", "-o", tmp_path / name) == 0
    usual, black, middle, right = (
        layer(read_channels(tmp_path / name / "separation.exr"), "specular")
        for name in ("usual", "black", "middle", "right")
    )
    assert (
        usual[:, :60].max() > 0.2
        and not black.any()
        and np.abs(middle - usual).max() < 1e-3 * usual.max()
    )
    assert not right[:, :60].any() and np.array_equal(right[:, 60:], middle[:, 60:])


def test_a_prior_of_another_size_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    prior = write_image(tmp_path / "prior.png", np.full((96, 119), 128, np.uint8))
    assert isc("separate", disc_photo(tmp_path), "--prior", prior, "-o", tmp_path / "out") == 2
    error = capfd.readouterr().err
    assert (
        "prior.png: the prior is 119 x 96 pixels, the photo 120 x 96: use a prior of" in error
        and error.count("\n") == 1
    )
    assert not (tmp_path / "out").exists()


def test_separate_uses_the_whole_frame_without_a_mask(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    photo = write_image(tmp_path / "full.png", ball_codes() // 2 + 9000)
    assert isc("separate", photo, "--whole", "--method", "none", "-o", tmp_path / "out") == 0
    assert "note: no mask: the whole image was processed" in capfd.readouterr().out
    assert read_channels(tmp_path / "out" / "separation.exr")["diffuse.G"].min() > 0


@pytest.mark.parametrize("kind", ["alpha", "black border"])
def test_whole_ignores_alpha_and_a_black_border(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], kind: str
) -> None:
    codes = (ball_codes() // 257).astype(np.uint8)
    if kind == "alpha":
        alpha = np.where(codes.max(-1) > 0, 255, 0).astype(np.uint8)
        codes = np.dstack([codes // 2 + 30, alpha])
    photo, out = tmp_path / "photo.png", tmp_path / "out"
    Image.fromarray(codes).save(photo)
    assert isc("separate", photo, "--whole", "--method", "none", "-o", out) == 0
    assert "the whole image was processed" in capfd.readouterr().out
    diffuse = read_channels(out / "separation.exr")["diffuse.G"]
    light = srgb_to_linear(codes[..., 1] / 255)
    assert np.allclose(diffuse, light, atol=1e-3)


def test_mask_finds_the_ball_in_its_box(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    codes = ball_codes(40.0)
    truth = codes.max(-1) > 0
    backdrop = np.random.default_rng(2).integers(20000, 26000, codes.shape).astype(np.uint16)
    photo = write_image(tmp_path / "photo.png", np.where(truth[..., None], codes, backdrop))
    assert isc("mask", photo, "--box", "3,2,88,88", "-o", tmp_path / "mask.png") == 0
    assert "check it" in capfd.readouterr().out
    found = read_photo(photo, tmp_path / "mask.png").mask
    assert (found & truth).sum() / (found | truth).sum() > 0.9


def test_evaluate_scores_and_writes(
    shared: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    root = shared / "data" / "mit_berkeley_train"
    options = [
        "--dataset",
        "mit-berkeley",
        "--objects",
        "apple",
        "--model",
        "naive",
        "--input",
        "original",
    ]
    assert (
        isc("evaluate", root, *options, "--quiet", "--json", tmp_path / "new" / "scores.json") == 0
    )
    scores = json.loads((tmp_path / "new" / "scores.json").read_text())
    assert list(scores["results"]) == ["laboratory/original"]
    average = scores["results"]["laboratory/original"]["apple"]["avg"]
    assert f"{average:.5f}" in capfd.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "light", "input"),
    [("sirfs", "natural", "diffuse"), ("mdr", "laboratory", "original")],
)
def test_what_is_evaluated_explains_the_image(
    shared: Path, model: str, light: str, input: str
) -> None:
    """Shading times reflectance is the photo, for mdr its diffuse layer, and the surface is not
    flat.
    """
    truth = load_object(shared / "data" / "mit_berkeley_train", "apple", light, input)
    answer = make_runner(RunnerOptions(model), shipped_prior_set())(truth, Monitor())
    product = (answer.shading * answer.reflectance)[truth.valid]
    diffuse = truth.image if model == "sirfs" else separate(BEST, truth.image, truth.valid).diffuse
    np.testing.assert_allclose(product, np.maximum(diffuse[truth.valid], 0.5 / 65535), rtol=1e-6)
    assert model == "sirfs" or np.abs(diffuse - truth.image)[truth.valid].max() > 0.001
    assert answer.loss is not None and answer.evaluations is not None
    assert np.linalg.norm(answer.normal, axis=-1) == pytest.approx(1)
    assert answer.normal[truth.valid][:, 2].min() < 0.5


@pytest.mark.slow
def test_priors_are_fitted_to_the_chosen_objects(
    shared: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In a few steps of the fit; whole fits are tested where it is."""
    steps = TableFitOptions(max_steps=4, runs=1)
    few = FitOptions(iterations=4, absolute=steps, grey_absolute=steps)
    monkeypatch.setattr("isc_core.prior_fitting.fit.FitOptions", lambda: few)
    root, path = shared / "data" / "mit_berkeley_train", tmp_path / "priors.npz"
    assert isc("fit-priors", root, "--objects", "box", "-o", path) == 2
    assert "at least two" in capfd.readouterr().err
    left_out = "apple,cup1,dinosaur,panther,paper1,phone,squirrel"
    assert isc("fit-priors", root, "--leave-out", left_out, "--quiet", "-o", path) == 0
    assert load_prior_set(path).record.objects == ("box", "frog1", "teabag2")
    assert (
        isc("decompose", ball_photo(tmp_path), "--priors", path, "--quiet", "-o", tmp_path / "out")
        == 0
    )
    assert isc("fit-priors", root, "--leave-out", "teapot", "-o", tmp_path / "new.npz") == 2
    assert "unknown object 'teapot'" in capfd.readouterr().err
    assert not (tmp_path / "new.npz").exists()


# --- stopping -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_during_the_solve_leaves_nothing(tmp_path: Path, number: signal.Signals) -> None:
    photo = ball_photo(tmp_path, 110.0)
    command = isc_command("decompose", photo, "--engine", "numpy", "-o", tmp_path / "new" / "out")
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        stages = []
        for line in process.stderr:
            stages.append(line)
            if "shape and light" in line:
                process.send_signal(number)
        code = process.wait(timeout=60)
    assert code == (130 if number == signal.SIGINT else 143), stages
    assert not any("Traceback" in line for line in stages)
    assert (stages[-1] == "isc: cancelled\n") == (number == signal.SIGINT)
    assert [entry.name for entry in tmp_path.iterdir()] == ["ball.png"]


def test_the_first_interrupt_asks_and_the_second_insists() -> None:
    interrupts = Interrupts()
    monitor = interrupts.monitor(lambda event: None)

    def work() -> None:
        with interrupts:
            monitor.report("work", 0.0)
            signal.raise_signal(signal.SIGINT)
            with pytest.raises(Cancelled):
                monitor.report("work", 0.5)
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)

    with pytest.raises(Cancelled):  # what the work ends with does not matter
        work()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_ignored_interrupt_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with Interrupts() as interrupts:
            signal.raise_signal(signal.SIGINT)
            interrupts.monitor(lambda event: None).report("work", 0.0)
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_the_command_also_runs_outside_the_main_thread(tmp_path: Path) -> None:
    photo, codes = ball_photo(tmp_path), []
    thread = threading.Thread(
        target=lambda: codes.append(
            isc("separate", photo, "--method", "none", "--quiet", "-o", tmp_path / "out")
        )
    )
    thread.start()
    thread.join()
    assert codes == [0]


@pytest.mark.slow
def test_a_reader_that_goes_away_is_no_error() -> None:
    pipe = f"{sys.executable} -m isc_core decompose --help | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", pipe], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode in (0, 1)
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "memory"),
        (OSError(5, "Input/output error", "disk"), "disk: Input/output error"),
    ],
)
def test_trouble_with_the_machine_is_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: BaseException,
    words: str,
) -> None:
    def fail(options: object, monitor: object) -> list[str]:
        raise error

    monkeypatch.setattr("isc_core.cli.commands.mask.run", fail)
    assert main(["mask", "photo.png", "--box", "1,1,9,9", "-o", "mask.png"]) == 2
    text = capsys.readouterr().err
    assert words in text and text.count("\n") == 1


# --- the terminal ---------------------------------------------------------------------------------


def test_a_terminal_shows_one_line_that_is_wiped_at_the_end() -> None:
    text = through_terminal(
        sys.executable,
        "-c",
        "import sys; from isc_core.cli.interface.terminal import ProgressBar\n"
        "from isc_core.progress import ProgressEvent as E\n"
        "with ProgressBar(sys.stderr) as bar:\n"
        "    bar(E('separating', 0.25)); bar(E('shape and light', 0.5, 'loss 46.100'))\n"
        "    bar(E('maps ' + 99 * '.', 0.4))\n",
    )
    assert "\n" not in text
    frames = text.split("\r\x1b[K")[1:]
    assert frames[0] == "[######..................]  25 %  separating"
    assert frames[1].endswith(" 50 %  shape and light, loss 46.100")
    assert " 50 %  maps" in frames[2] and len(frames[2]) == 79
    assert frames[-1] == ""


def test_a_terminal_is_not_redrawn_for_every_step() -> None:
    start = time.monotonic()
    text = through_terminal(
        sys.executable,
        "-c",
        "import sys; from isc_core.cli.interface.terminal import ProgressBar\n"
        "from isc_core.progress import ProgressEvent as E\n"
        "with ProgressBar(sys.stderr) as bar:\n"
        "    for k in range(20000): bar(E('shape and light', k / 20000, f'loss {k}'))\n",
    )
    assert 2 <= text.count("\r") <= 3 + (time.monotonic() - start) / 0.08


def test_a_note_takes_the_place_of_the_progress_bar() -> None:
    text = through_terminal(
        sys.executable,
        "-c",
        "import sys; from isc_core.cli.interface.terminal import ProgressBar, print_note\n"
        "from isc_core.progress import ProgressEvent as E\n"
        "with ProgressBar(sys.stderr) as bar:\n"
        "    bar(E('starting workers', 0.0)); print_note('6 images', sys.stderr)\n"
        "    bar(E('images', 0.5))\n",
    )
    frames = text.split("\r\x1b[K")[1:]
    assert frames[0].endswith("  0 %  starting workers")
    assert frames[1] == "isc: 6 images\r\n"
    assert frames[2].endswith(" 50 %  images")


def test_a_file_gets_a_line_for_each_stage(tmp_path: Path) -> None:
    with (tmp_path / "log").open("w") as log, ProgressBar(log) as bar:
        for loss in (3.0, 2.0, 1.0):
            bar(ProgressEvent("shape and light", 0.1, f"loss {loss}"))
        bar(ProgressEvent("maps", 0.9))
    assert (tmp_path / "log").read_text() == "isc: shape and light\nisc: maps\n"


# --- compiled kernels -----------------------------------------------------------------------------


@pytest.mark.slow
def test_kernels_work_where_none_can_be_kept(tmp_path: Path) -> None:
    """Numba refuses functions that it cannot cache; here it is forbidden every folder but one that
    is named, and none is.
    """
    pytest.importorskip("numba")
    check = (
        "import os, numba; from isc_core.numerics.jit import ensure_cache_folder; "
        "ensure_cache_folder()\n"
        "from isc_core.numerics import kernel_library; kernel_library.FOLDER /= 'none'\n"
        "from isc_core.sirfs.kernels.height_rows import forward_rows\n"
        "print(forward_rows.compiled.stats.cache_path)"
    )
    environment = {
        **os.environ,
        "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator",
        "TMPDIR": str(tmp_path),
    }
    done = subprocess.run(
        [sys.executable, "-c", check],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(tmp_path))
    assert not list(tmp_path.iterdir())


def test_the_first_compilation_is_announced(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("numba")
    from isc_core.sirfs import kernel_cache

    monkeypatch.setattr(kernel_cache, "shipped_library", lambda: None)
    monkeypatch.setattr(kernel_cache, "_folder", lambda: tmp_path)
    stages: list[str] = []
    monitor = Monitor(lambda event: stages.append(event.stage))
    for compiled in (True, False):
        monkeypatch.setattr(kernel_cache, "kernels_compiled", lambda known=compiled: known)
        kernel_cache.announce_compilation("auto", monitor)
        kernel_cache.announce_compilation("numpy", monitor)
        assert len(stages) == (0 if compiled else 1)
    assert "compiled kernels" in stages[0]


def test_kernels_count_as_compiled_once_they_were_used(result: Path) -> None:
    pytest.importorskip("numba")
    from isc_core.sirfs.kernel_cache import kernels_compiled

    if shipped_library() is not None:
        pytest.skip("the kernels were compiled ahead of time")
    assert load(result / "result").provenance.diagnostics.converged in (True, False)
    assert kernels_compiled()


@pytest.mark.parametrize("cancellation", [Cancelled(), KeyboardInterrupt()])
def test_a_cancelled_command_says_how_to_go_on(
    cancellation: BaseException,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    cancellation.add_note("repeat the command to continue")
    monkeypatch.setattr("isc_core.cli.main._run", Mock(side_effect=cancellation))
    assert main(["refine"]) == 130
    assert capsys.readouterr().err == "isc: cancelled; repeat the command to continue\n"
