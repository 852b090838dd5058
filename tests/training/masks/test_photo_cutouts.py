"""Cut-outs of photographs: what is taken for one, the splits, and the colours."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isc_core.errors import InputError

pytest.importorskip("torch")

from training.masks.packs import Ingredients
from training.masks.photo_cutouts import Part, photo_cutouts, read_cut_photos

_SIZE = 96


def _save(
    path: Path, colour: tuple[int, int, int], noise: float, alpha: int = 255, size: int = _SIZE
) -> None:
    """Save a disc of one colour with noise in front of a transparent background."""
    rng = np.random.default_rng(0)
    across = np.arange(size) - (size - 1) / 2
    disc = np.hypot(across, across[:, None]) < 0.4 * size
    codes = np.array(colour) + noise * rng.normal(size=(size, size, 3))
    layers = np.concatenate([codes, alpha * disc[..., None]], axis=2)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(layers.round().clip(0, 255).astype(np.uint8)).save(path)


def test_photographs_have_noise(tmp_path: Path) -> None:
    """Drawings, translucent and small things, pictures without transparency, and the folders to
    leave out are no photographs.
    """
    _save(tmp_path / "animals/owl.png", (200, 100, 50), 5)
    _save(tmp_path / "animals/drawn.png", (200, 100, 50), 0)
    _save(tmp_path / "animals/ghost.png", (200, 100, 50), 5, alpha=128)
    _save(tmp_path / "animals/fly.png", (200, 100, 50), 5, size=32)
    _save(tmp_path / "cartoon/owl.png", (200, 100, 50), 5)
    Image.open(tmp_path / "animals/owl.png").convert("RGB").save(tmp_path / "opaque.png")
    assert [one.path.stem for one in read_cut_photos(tmp_path, ("cartoon",))] == ["owl"]


def test_pictures_of_the_same_thing_stay_together(tmp_path: Path) -> None:
    """A quarter is held out, and names that differ by a number or a suffix share their part."""
    for k in range(26):
        for suffix in ("1", "2_mirror"):
            _save(tmp_path / f"things/{chr(97 + k)}x{suffix}.png", (90, 90, 90), 9)
    parts = [one.part for one in read_cut_photos(tmp_path)]
    assert parts[::2] == parts[1::2]
    counts = [parts[::2].count(part) for part in (Part.CHOICE, Part.TEST)]
    assert min(counts) >= 1
    assert sum(counts) <= 13


def test_cut_outs_have_the_colours_of_the_photograph(tmp_path: Path) -> None:
    """Up to a common brightness; coverage is alpha; files of them are read after others."""
    _save(tmp_path / "ball.png", (200, 100, 50), 4)
    photos = read_cut_photos(tmp_path)
    cutouts = photo_cutouts(photos, photos[0].part)
    inside = cutouts[0, 3] > 250
    assert inside.mean() == pytest.approx(np.pi / 4 * (120 / 128) ** 2, abs=0.02)
    mean = cutouts[0, :3, inside].mean(axis=0)
    assert mean[1:] / mean[0] == pytest.approx([0.5, 0.25], abs=0.03)
    path = tmp_path / "photos.npz"
    Ingredients.of_cutouts(cutouts).write(path)
    again = Ingredients.read([path, path])
    assert again.cutouts.shape == (2, *cutouts.shape[1:])
    assert not len(again.panoramas)


def test_a_folder_without_photographs_is_refused(tmp_path: Path) -> None:
    """As is a file that is no picture: one line each."""
    with pytest.raises(InputError, match="no photographs"):
        read_cut_photos(tmp_path)
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"broken\.png: not a PNG"):
        read_cut_photos(tmp_path)


def test_a_part_without_photographs_is_refused(tmp_path: Path) -> None:
    """One photograph belongs to one part."""
    _save(tmp_path / "owl.png", (200, 100, 50), 5)
    photos = read_cut_photos(tmp_path)
    others = [part for part in Part if part != photos[0].part]
    with pytest.raises(InputError, match="none of 1 photographs belongs to part"):
        photo_cutouts(photos, others[0])
