"""Masks from a box: exact, the same every time, written whole or not at all."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.photo import read_photo
from isc_core.photo.grabcut import cut_out, grabcut, write_mask


def scene(h: int = 120, w: int = 160) -> tuple[np.ndarray, np.ndarray]:
    """(photo codes (H, W, 3) uint8, truth (H, W) bool): a red shaded disc on a noisy blue-green
    background.
    """
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:h, :w]
    truth = ((x - 0.5 * w) ** 2 + (y - 0.5 * h) ** 2) < (0.3 * h) ** 2
    disc = np.array([200, 60, 40]) * (0.5 + 0.5 * (x / w))[..., None]
    image = np.where(truth[..., None], disc, [40, 90, 140]) + rng.normal(0, 6, (h, w, 3))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), truth


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


def test_grabcut_finds_the_object() -> None:
    image, truth = scene()
    box = (36, 16, 88, 88)
    found = grabcut(image, box)
    assert found.shape == truth.shape and found.dtype == bool
    assert overlap(found, truth) > 0.97
    outside = np.ones_like(found)
    outside[16:104, 36:124] = False
    assert not found[outside].any()


def test_grabcut_is_the_same_every_time_and_in_linear_light() -> None:
    image, truth = scene()
    box = (36, 16, 88, 88)
    first = grabcut(image, box)
    cv2.setRNGSeed(12345)
    np.random.default_rng().random(5)
    assert (grabcut(image, box) == first).all()
    assert overlap(grabcut(srgb_to_linear(image / 255).astype(np.float32), box), truth) > 0.97


@pytest.mark.slow
def test_large_boxes_are_solved_smaller() -> None:
    image, truth = scene(1200, 1600)
    assert overlap(grabcut(image, (400, 200, 800, 800), iterations=2), truth) > 0.97


@pytest.mark.parametrize(
    ("box", "words"),
    [
        ((-1, 5, 50, 50), "extends beyond the image of 160 x 120"),
        ((120, 5, 50, 50), "extends beyond the image"),
        ((5, 5, 7, 50), "at least 8 pixels"),
        ((5, 5, 50, -3), "at least 8 pixels"),
        ((0, 0, 160, 120), "covers the whole image"),
    ],
)
def test_bad_boxes(box: tuple[int, int, int, int], words: str) -> None:
    with pytest.raises(InputError) as caught:
        grabcut(scene()[0], box)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_strip_of_background_too_thin_to_learn_from() -> None:
    image, _ = scene(1501, 2000)
    with pytest.raises(InputError, match="too little background"):
        grabcut(image, (0, 0, 2000, 1500))


def test_nothing_found() -> None:
    with pytest.raises(InputError, match="the mask that GrabCut finds"):
        grabcut(np.full((60, 80, 3), 90, np.uint8), (20, 20, 30, 30))


def test_a_mask_is_written_whole(tmp_path: Path) -> None:
    _, truth = scene()
    path = tmp_path / "mask.png"
    path.write_bytes(b"an older file")
    write_mask(path, truth)
    stored = np.asarray(Image.open(path))
    assert stored.dtype == np.uint8 and (stored == np.where(truth, 255, 0)).all()
    assert [p.name for p in tmp_path.iterdir()] == ["mask.png"]


def test_a_mask_that_cannot_be_written(tmp_path: Path) -> None:
    _, truth = scene()
    with pytest.raises(InputError, match="ends in .png"):
        write_mask(tmp_path / "mask.jpg", truth)
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match="choose a file"):
        write_mask(tmp_path / "folder.png", truth)
    (tmp_path / "folder.png" / "file").write_bytes(b"")
    with pytest.raises(InputError, match="not a folder"):
        write_mask(tmp_path / "folder.png" / "file" / "mask.png", truth)
    assert [p.name for p in tmp_path.iterdir()] == ["folder.png"]


def test_cut_out_makes_a_mask_that_the_photo_accepts(tmp_path: Path) -> None:
    image, truth = scene()
    Image.fromarray(image).save(tmp_path / "photo.png")
    with pytest.raises(InputError, match="isc mask PHOTO --box"):
        read_photo(tmp_path / "photo.png")
    found = cut_out(tmp_path / "photo.png", (36, 16, 88, 88), tmp_path / "mask.png")
    photo = read_photo(tmp_path / "photo.png", tmp_path / "mask.png")
    assert (photo.mask == found).all() and overlap(found, truth) > 0.97


def test_cut_out_of_a_black_photo(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((60, 80, 3), np.uint8)).save(tmp_path / "photo.png")
    with pytest.raises(InputError, match="image is black"):
        cut_out(tmp_path / "photo.png", (20, 20, 30, 30), tmp_path / "mask.png")
    assert not (tmp_path / "mask.png").exists()


@pytest.mark.slow
def test_cut_out_of_a_real_photo(shared: Path, tmp_path: Path) -> None:
    found = cut_out(
        shared / "data" / "highlight" / "fish.ppm", (60, 60, 500, 360), tmp_path / "mask.png"
    )
    assert found.any() and (tmp_path / "mask.png").exists()
