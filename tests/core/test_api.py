"""The Python interface: files and arrays, masks, settings, saving and loading."""

import importlib
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import isc_core
from isc_core import InputError, Settings
from isc_core.cli.main import main
from isc_core.photo import read_photo
from tests.core.command_line import ROOT, ball_codes, ball_photo

NAIVE = Settings(model="naive")


@pytest.fixture(scope="module")
def codes() -> np.ndarray:
    """The ball's photo, (H, W, 3) uint16 sRGB codes."""
    return ball_codes()


def test_a_file_and_its_array_give_the_same_result(tmp_path: Path, codes: np.ndarray) -> None:
    path = ball_photo(tmp_path)
    from_file = isc_core.decompose(path, settings=NAIVE)
    from_array = isc_core.decompose(codes, settings=NAIVE)
    from_photo = isc_core.decompose(read_photo(path), settings=NAIVE)
    for name in ("image", "reflectance", "shading", "normal", "height", "mask"):
        expected = getattr(from_file, name)
        assert np.array_equal(getattr(from_array, name), expected), name
        assert np.array_equal(getattr(from_photo, name), expected), name
    assert from_file.provenance.input["name"] == "ball.png"
    assert from_array.identity_errors().broken() == ()


def test_floats_are_linear_and_codes_are_srgb(codes: np.ndarray) -> None:
    photo = isc_core.decompose(codes, settings=NAIVE)
    linear = isc_core.decompose(photo.image, settings=NAIVE)
    np.testing.assert_array_equal(linear.image, photo.image)
    same = isc_core.decompose(codes.astype(np.float64) / 65535, settings=NAIVE, transfer="srgb")
    np.testing.assert_allclose(same.image, photo.image, atol=1e-6)


@pytest.mark.parametrize("kind", [bool, np.uint8, np.float32])
def test_a_mask_is_an_array_or_a_file(tmp_path: Path, codes: np.ndarray, kind: type) -> None:
    mask = np.zeros(codes.shape[:2], bool)
    mask[14:34, 18:36] = True
    Image.fromarray((255 * mask).astype(np.uint8)).save(tmp_path / "mask.png")
    path = ball_photo(tmp_path)
    for image in (codes, path):
        from_array = isc_core.decompose(image, mask.astype(kind), settings=NAIVE)
        from_file = isc_core.decompose(image, tmp_path / "mask.png", settings=NAIVE)
        assert np.array_equal(from_array.mask, mask)
        assert np.array_equal(from_file.mask, mask)


def test_alpha_and_grey(codes: np.ndarray) -> None:
    inside = codes.max(axis=2) > 0
    rgba = np.dstack([codes >> 8, np.where(inside, 255, 0)]).astype(np.uint8)
    assert np.array_equal(isc_core.decompose(rgba, settings=NAIVE).mask, inside)
    grey = isc_core.decompose(codes[..., 1], settings=NAIVE)
    assert np.array_equal(grey.image[..., 0], grey.image[..., 2])


def test_results_survive_saving(tmp_path: Path, codes: np.ndarray) -> None:
    result = isc_core.decompose(codes, settings=NAIVE)
    isc_core.save(result, tmp_path / "ball")
    loaded = isc_core.load(tmp_path / "ball")
    assert np.array_equal(loaded.reflectance, result.reflectance)
    assert loaded.provenance.settings["model"] == "naive"


def test_layers_can_be_separated_and_saved(tmp_path: Path, codes: np.ndarray) -> None:
    layers = isc_core.separate(codes)
    image = layers.diffuse + layers.specular + layers.residual
    np.testing.assert_allclose(image, read_photo(ball_photo(tmp_path)).image, atol=1e-6)
    isc_core.save(layers, tmp_path / "layers")
    assert (tmp_path / "layers" / "separation.exr").is_file()
    patch = codes[18:30, 18:30]  # no border and no mask: all of it
    whole = isc_core.separate(patch, method="none")
    assert np.array_equal(whole.diffuse > 0, patch > 0)


def files_of(folder: Path) -> dict[str, bytes]:
    """The contents of a folder's files, without what differs between equal runs."""
    return {
        path.name: path.read_bytes()
        for path in folder.iterdir()
        if path.is_file() and path.name not in ("decomposition.json", "preview.png")
    }


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["soft", "found"])
def test_a_saved_result_has_the_files_of_the_command(tmp_path: Path, kind: str) -> None:
    codes, photo = ball_codes(12.0) >> 8, tmp_path / "ball.png"
    row, column = np.indices(codes.shape[:2])
    if kind == "soft":
        middle = np.argwhere(codes.max(axis=2) > 0).mean(axis=0)
        away = np.hypot(row - middle[0], column - middle[1])
        codes = np.dstack([codes, np.clip(255 * (12 - away) / 3, 0, 255)])
    else:
        codes[codes.max(axis=2) == 0] = (90, 110, 130)
    Image.fromarray(codes.astype(np.uint8)).save(photo)
    assert main(["decompose", str(photo), "-q", "--model", "naive", "-o", f"{tmp_path}/a"]) == 0
    expected = files_of(tmp_path / "a")
    assert "mask.png" in expected
    isc_core.save(isc_core.decompose(photo, settings=NAIVE), tmp_path / "b")
    isc_core.save(isc_core.load(tmp_path / "b"), tmp_path / "c")
    assert files_of(tmp_path / "b") == files_of(tmp_path / "c") == expected


def test_a_result_with_a_found_mask_can_be_exported_with_its_photo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    codes, photo = ball_codes(12.0) >> 8, tmp_path / "ball.png"
    codes[codes.max(axis=2) == 0] = (90, 110, 130)
    Image.fromarray(codes.astype(np.uint8)).save(photo)
    folder = tmp_path / "ball"
    isc_core.save(isc_core.decompose(photo, settings=NAIVE), folder)
    words = ["export", str(folder), "-q", "--photo", str(photo), "--format", "glb"]
    assert main([*words, "-o", f"{tmp_path}/a.glb"]) == 0
    (folder / "mask.png").unlink()
    assert main([*words, "-o", f"{tmp_path}/b.glb"]) == 2
    assert "has no mask.png" in capsys.readouterr().err and not (tmp_path / "b.glb").exists()


def test_a_saved_separation_has_the_files_of_the_command(tmp_path: Path) -> None:
    codes, photo = ball_codes(12.0) >> 8, tmp_path / "ball.png"
    codes[codes.max(axis=2) == 0] = (90, 110, 130)
    Image.fromarray(codes.astype(np.uint8)).save(photo)
    words = ["separate", str(photo), "-q", "--method", "shen_2013"]
    assert main([*words, "-o", f"{tmp_path}/a"]) == 0
    isc_core.save(isc_core.separate(photo, method="shen_2013"), tmp_path / "b")
    expected = files_of(tmp_path / "a")
    assert "mask.png" in expected and files_of(tmp_path / "b") == expected


@pytest.mark.parametrize(
    ("image", "mask", "message"),
    [
        (np.zeros((40, 40, 2), np.uint8), None, "shape (40, 40, 2)"),
        (np.zeros((40, 40, 3), np.int64), None, "type int64"),
        (np.zeros((40, 40, 3), np.uint8), None, "black"),
        (np.zeros((4, 40, 3), np.uint8), None, "at least 8"),
        ("codes", np.ones((3, 3), bool), "the mask"),
        ("codes", np.ones((41, 40), bool), "mask of the photo's size"),
        ("codes", "none.png", "none.png: there is no such file"),
        ("none.png", None, "none.png: there is no such file"),
    ],
)
def test_what_cannot_be_used_is_named(
    codes: np.ndarray, image: np.ndarray | str, mask: np.ndarray | str | None, message: str
) -> None:
    given = codes if isinstance(image, str) and image == "codes" else image
    with pytest.raises(InputError) as refusal:
        isc_core.decompose(given, mask, settings=NAIVE)
    assert message in str(refusal.value)


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({"height": np.zeros((5, 7))}, "the shape map is 7 x 5 but the photo"),
        ({"height": np.zeros((5, 7, 1))}, "array of numbers (height, width)"),
        ({"depth": [[1.0, 2.0]]}, "array of numbers (height, width)"),
        ({"light": np.zeros((3, 9))}, "array (9, 3)"),
        ({"light": np.full((9, 3), np.nan)}, "array (9, 3)"),
        ({"light": np.full((9, 3), 1e6)}, "logarithm of shading"),
        ({"depth_sigma": 0}, "the sigma of the depth must be a number from 1e-06"),
        ({"depth_sigma": float("nan")}, "not nan"),
        ({"depth_sigma": "2"}, "not '2'"),
        ({"depth_weight": -3.0}, "the weight of the depth must be a number from 0"),
    ],
)
def test_known_inputs_that_cannot_be_used_are_named(
    codes: np.ndarray, known: dict[str, Any], message: str
) -> None:
    settings = Settings(model="sirfs", max_size=32)
    with pytest.raises(InputError) as refusal:
        isc_core.decompose(codes, settings=settings, known=isc_core.KnownInputs(**known))
    assert message in str(refusal.value)


def test_a_photo_has_its_own_mask(tmp_path: Path) -> None:
    photo = read_photo(ball_photo(tmp_path))
    with pytest.raises(InputError, match="already has a mask"):
        isc_core.decompose(photo, photo.mask)


def test_every_exported_name_exists() -> None:
    assert all(hasattr(isc_core, name) for name in isc_core.__all__)
    importlib.import_module("isc_core.decomposition.pipeline")
    assert callable(isc_core.decompose)  # the package does not hide the function
    with pytest.raises(AttributeError, match="no attribute 'recompose'"):
        getattr(isc_core, "recompose")  # noqa: B009


def test_the_lines_of_the_readme_run_as_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", readme, re.DOTALL | re.MULTILINE)
    assert len(blocks) == 1
    assert len([line for line in blocks[0].splitlines() if line]) == 5
    shutil.move(ball_photo(tmp_path, 12.0), tmp_path / "cup.png")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    done = subprocess.run(
        [sys.executable, "-c", blocks[0]], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cup", "cup.png"]
