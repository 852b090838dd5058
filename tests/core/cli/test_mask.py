"""`isc mask` and the masks that other commands find: files, lines, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isc_core.cli.main import main
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.photo import read_photo
from isc_core.photo.mask_overlay import mask_overlay
from tests.core.command_line import write_image
from tests.core.masking.ball_photos import ONE, TWO, balls, overlap


def photo(folder: Path, places: tuple[tuple[float, float, float], ...]) -> tuple[Path, np.ndarray]:
    """A file of balls before a wall, and the mask of all of them."""
    light, masks = balls(places)
    codes = np.rint(255 * linear_to_srgb(light)).astype(np.uint8)
    truth = np.any(masks, axis=0) if masks else np.zeros(light.shape[:2], bool)
    return write_image(folder / "photo.png", codes), truth


def mask_in(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path)) > 127


def isc(*words: object) -> int:
    return main([str(word) for word in words])


def test_a_mask_is_found_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, truth = photo(tmp_path, ONE)
    assert isc("mask", path, "--auto", "-o", tmp_path / "mask.png") == 0
    assert overlap(mask_in(tmp_path / "mask.png"), truth) > 0.95
    assert "pixels, confidence " in capsys.readouterr().out
    codes = np.unique(np.asarray(Image.open(tmp_path / "mask.png")))
    assert len(codes) > 2, "the rim is soft"


def test_an_overlay_shows_the_mask_on_the_photo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, _ = photo(tmp_path, ONE)
    files = ("-o", tmp_path / "mask.png", "--overlay", tmp_path / "overlay.png")
    assert isc("mask", path, "--auto", *files) == 0
    shown = np.asarray(Image.open(tmp_path / "overlay.png")).astype(int)
    before, inside = np.asarray(Image.open(path)).astype(int), mask_in(tmp_path / "mask.png")
    assert shown.shape == before.shape, "a photo of 200 x 150 pixels is not scaled"
    orange = (shown == [255, 140, 26]).all(-1)
    assert 0 < orange.sum() < inside.sum() / 4
    same = np.abs(shown - before).max(-1) <= 1
    assert same[inside & ~orange].mean() > 0.9, "the object as it is, but for its rim"
    wall = shown[~inside]
    assert (wall[:, 0] > wall[:, 1]).mean() > 0.99, "the background is tinted red"
    assert isc("mask", path, "--each", *files) == 2
    assert "leave out --each" in capsys.readouterr().err


def test_a_large_photo_has_a_small_overlay() -> None:
    mask = np.zeros((900, 600), bool)
    mask[300:600, 200:400] = True
    picture = mask_overlay(np.full((900, 600, 3), 0.5, np.float32), mask)
    assert picture.shape[0] == 256 and picture.dtype == np.uint8
    assert abs(picture.shape[1] - 171) <= 1


def soft_alpha(folder: Path) -> tuple[Path, np.ndarray]:
    """A photo of noise with a disc that fades out over many pixels, and its alpha channel."""
    row, column = np.indices((120, 120)) - 60
    alpha = np.rint(255 * np.clip(0.5 - (np.hypot(row, column) - 40) / 20, 0, 1)).astype(np.uint8)
    colour = np.random.default_rng(0).integers(90, 160, (120, 120, 3)).astype(np.uint8)
    colour[alpha == 0] = 0
    Image.fromarray(np.dstack([colour, alpha])).save(folder / "soft.png")
    return folder / "soft.png", alpha


def test_the_mask_of_an_alpha_channel_is_as_soft_as_that(tmp_path: Path) -> None:
    path, alpha = soft_alpha(tmp_path)
    mask = tmp_path / "mask.png"
    assert isc("mask", path, "--auto", "-o", mask) == 0
    assert np.array_equal(np.asarray(Image.open(mask)), alpha)
    own, given = read_photo(path), read_photo(path, mask)
    assert own.cover is not None and given.cover is not None
    assert np.allclose(given.cover, own.cover)
    assert np.array_equal(given.image, own.image), "the colours are the object's own"


@pytest.mark.parametrize("exposure", [0.01, 1.0, 50.0])
def test_the_overlay_of_a_float_photo_shows_it_at_any_exposure(
    tmp_path: Path, exposure: float
) -> None:
    light, _ = balls(ONE)
    np.save(tmp_path / "photo.npy", exposure * light)
    files = ("-o", tmp_path / "mask.png", "--overlay", tmp_path / "overlay.png")
    assert isc("mask", tmp_path / "photo.npy", "--auto", *files) == 0
    inside = mask_in(tmp_path / "mask.png")
    shown = np.asarray(Image.open(tmp_path / "overlay.png"))[inside].max(-1)
    assert np.percentile(shown, 99) > 230 and np.percentile(shown, 50) < 200
    assert np.ptp(np.percentile(shown, (5, 95))) > 90


def test_each_object_gets_a_mask(tmp_path: Path) -> None:
    path, truth = photo(tmp_path, TWO)
    assert isc("mask", path, "--each", "-o", tmp_path / "mask.png") == 0
    assert sorted(one.name for one in tmp_path.glob("mask*")) == ["mask_1.png", "mask_2.png"]
    found = mask_in(tmp_path / "mask_1.png") | mask_in(tmp_path / "mask_2.png")
    assert overlap(found, truth) > 0.8


def test_no_mask_replaces_the_photo_or_the_overlay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, _ = photo(tmp_path, TWO)
    shelf = path.rename(tmp_path / "shelf_2.png")
    before = shelf.read_bytes()
    assert isc("mask", shelf, "--each", "-o", tmp_path / "shelf.png") == 2
    assert "is the photo itself" in capsys.readouterr().err
    assert shelf.read_bytes() == before and not (tmp_path / "shelf_1.png").exists()
    mask = tmp_path / "mask.png"
    assert isc("mask", shelf, "--auto", "-o", mask, "--overlay", mask) == 2
    assert "is the mask itself" in capsys.readouterr().err
    assert not mask.exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((), "no object is selected: find it with --auto"),
        (("--auto",), "--box"),
        (("--point", "500,3"), "--point 500,3: lies outside of the photo of 200 x 150 pixels"),
        (("--point", "50,80", "--not", "50,80"), "contradict each other"),
        (("--point", "3,3", "--box", "20,20,80,90"), "lies outside of --box"),
        (("--each", "--point", "50,80"), "leave out --box, --point and --not"),
        (("--point", "50;80"), "'50;80' is not two integers x,y"),
    ],
)
def test_errors_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], expected: str
) -> None:
    path, _ = photo(tmp_path, ())
    try:
        code = isc("mask", path, *words, "-o", tmp_path / "mask.png")
    except SystemExit as error:  # argparse
        code = int(error.code or 0)
    printed = capsys.readouterr().err
    assert code == 2 and expected in printed
    assert not (tmp_path / "mask.png").exists()


def test_nothing_is_decomposed_without_an_object(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, _ = photo(tmp_path, ())
    assert isc("decompose", path, "-o", tmp_path / "out") == 2
    printed = capsys.readouterr().err
    assert "--box" in printed and "--point" in printed and not (tmp_path / "out").exists()


QUICK = ("--model", "sirfs", "--max-size", "24", "--separator", "none")


@pytest.mark.slow
def test_decompose_finds_the_mask_and_prints_a_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, truth = photo(tmp_path, ONE)
    assert isc("decompose", path, "-o", tmp_path / "out", *QUICK) == 0
    assert "found automatically" in capsys.readouterr().out
    assert isc("decompose", path, "-q", "-o", tmp_path / "out", *QUICK) == 0
    assert capsys.readouterr().out == ""
    assert overlap(mask_in(tmp_path / "out" / "mask.png"), truth) > 0.95
    given = json.loads((tmp_path / "out" / "decomposition.json").read_text())["input"]
    assert given["mask_from"] == "automatic" and 0.5 <= given["mask_confidence"] <= 1
    again = tmp_path / "again"
    mask = tmp_path / "out" / "mask.png"
    assert isc("decompose", path, "--mask", mask, "-o", again, *QUICK) == 0
    assert np.array_equal(mask_in(again / "mask.png"), mask_in(mask)), "its rim has greys"
    for result in (tmp_path / "out", again):
        edit = ("edit", result, "gloss", "--gain", "0.5", "--photo", path)
        assert isc(*edit, "-o", tmp_path / "edit") == 0, "an edit finds the mask in the result"


@pytest.mark.slow
def test_each_object_is_decomposed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, truth = photo(tmp_path, TWO)
    write_image(tmp_path / "mask.png", np.where(truth, 255, 0).astype(np.uint8))
    words = ("decompose", path, "--mask", tmp_path / "mask.png", *QUICK)
    assert isc(*words, "-o", tmp_path / "one") == 0
    assert "the mask has 2 separate parts" in capsys.readouterr().out
    edit = ("edit", tmp_path / "one", "gloss", "--gain", "0.5", "--photo", path)
    assert isc(*edit, "-o", tmp_path / "edit") == 2, "a mask without greys is not in the result"
    assert "give the same one with --mask" in capsys.readouterr().err
    assert isc(*words, "--each", "-o", tmp_path / "out") == 0
    boxes = [
        json.loads((tmp_path / "out" / name / "decomposition.json").read_text())["input"][
            "crop_box"
        ]
        for name in ("1", "2")
    ]
    assert boxes[0][0] < boxes[1][0] and boxes[0][2] < truth.shape[1] / 2
    left, right = (mask_in(tmp_path / "out" / name / "mask.png") for name in ("1", "2"))
    assert not (left & right).any() and np.array_equal(left | right, truth)
    edit = ("edit", tmp_path / "out" / "1", "gloss", "--gain", "0.5", "--photo", path)
    assert isc(*edit, "-o", tmp_path / "edit") == 0, "an edit finds the mask in the result"


@pytest.mark.slow
def test_separate_finds_the_mask_or_takes_the_whole(tmp_path: Path) -> None:
    path, truth = photo(tmp_path, ONE)
    assert isc("separate", path, "--method", "none", "-o", tmp_path / "out") == 0
    assert overlap(mask_in(tmp_path / "out" / "mask.png"), truth) > 0.95
    whole = ("separate", path, "--method", "none", "--whole", "-o", tmp_path / "whole")
    assert isc(*whole) == 0 and not (tmp_path / "whole" / "mask.png").exists()
