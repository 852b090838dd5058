"""Files of ingredients: what is read equals what was written, and bad files are refused."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from isc_core.errors import InputError
from isc_core.networks.mask_network import MaskNetwork
from training.masks import mask_network
from training.masks.ingredients import SIDE
from training.masks.packs import Ingredients


def ingredients(count: int) -> Ingredients:
    """Discs with gradients, before what is smooth."""
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2 + 0.5
    cover = np.clip(60 - np.hypot(x, y), 0, 1)
    colours = np.stack([128 + x, 128 - y, 200 + 0 * x]) * (cover > 0)
    disc = np.concatenate([colours, 255 * cover[None]]).round().astype(np.uint8)
    panoramas = np.exp(np.random.default_rng(0).normal(0, 2, (2, 8, 16, 3))).astype(np.float16)
    patterns = np.random.default_rng(1).integers(256, size=(3, 8, 8)).astype(np.uint8)
    return Ingredients(np.stack([disc] * count), panoramas, patterns)


def test_files_are_read_as_they_were_written(tmp_path: Path) -> None:
    sizes = [ingredients(k).write(tmp_path / f"{k}.npz") for k in (1, 2)]
    assert sizes[1] < 2 * 10_000
    found, wanted = Ingredients.read([tmp_path / "1.npz", tmp_path / "2.npz"]), ingredients(3)
    np.testing.assert_array_equal(found.cutouts[:, 3], wanted.cutouts[:, 3])
    np.testing.assert_array_equal(found.patterns, wanted.patterns)
    np.testing.assert_allclose(found.panoramas, wanted.panoramas, rtol=0.016)
    off = np.abs(found.cutouts[:, :3].astype(int) - wanted.cutouts[:, :3])
    off = off.transpose(0, 2, 3, 1)[wanted.cutouts[:, 3] > 0]
    assert off.mean() < 2 and off.max() < 20, "the rim, too, keeps its colours"


def test_other_files_are_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "learned.npz"
    with pytest.raises(InputError, match=r"learned\.npz cannot be read .*: make it again"):
        Ingredients.read([path])
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"learned\.npz is damaged or not a file of ingredients"):
        Ingredients.read([path])


def test_training_uses_two_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = [tmp_path / name for name in ("one", "two")]
    for folder in folders:
        folder.mkdir()
        for name in ("learned", "judged"):
            ingredients(1).write(folder / f"{name}.npz")
    given = ["--side", "32", "--batch", "2", "--steps", "2", "--threads", "1", "--workers", "1"]
    path = tmp_path / "out.npz"
    monkeypatch.setattr("sys.argv", ["mask_network", *map(str, folders), *given, "-o", str(path)])
    mask_network.main()
    MaskNetwork.read(path)
    printed = capsys.readouterr().out
    assert "step 2: loss" in printed and "held out: loss" in printed and "nan" not in printed


def test_a_folder_without_ingredients_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "out.npz"
    monkeypatch.setattr("sys.argv", ["mask_network", str(tmp_path), "-o", str(path)])
    with pytest.raises(SystemExit) as stopped:
        mask_network.main()
    assert stopped.value.code == 2 and not path.exists()
    assert "learned.npz cannot be read" in capsys.readouterr().err
