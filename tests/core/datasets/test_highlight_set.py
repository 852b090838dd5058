"""The photos with known layers: read as their publishers measure them."""

import json
from pathlib import Path

import numpy as np
import pytest

from isc_core.datasets.highlight_set import (
    SeparationTruth,
    list_shen_zheng,
    load_laboratory,
    load_rendered,
    load_shen_zheng,
)
from isc_core.errors import InputError
from isc_core.evaluation.metrics import mse, psnr
from isc_core.io.exr import write_channels
from tests.core.ball_scene import ball
from tests.core.command_line import write_image
from tests.core.training_objects import TRAINING_OBJECTS


def assert_fits(truth: SeparationTruth) -> None:
    assert (
        truth.image.shape == truth.diffuse.shape == truth.specular.shape == (*truth.mask.shape, 3)
    )
    assert truth.mask.any() and truth.mask.dtype == bool and truth.clipped.shape == truth.mask.shape
    for layer in (truth.image, truth.diffuse, truth.specular):
        assert np.isfinite(layer).all() and layer.min() >= 0


def test_shen_zheng_is_what_was_published(shared: Path) -> None:
    folder = shared / "data" / "highlight"
    anchors = json.loads((shared / "anchors" / "specular_removal.json").read_text())["shen"]
    assert list_shen_zheng(folder) == ("animals", "cups")
    for name in list_shen_zheng(folder):
        truth = load_shen_zheng(folder, name)
        assert_fits(truth)
        assert truth.mask.all() and truth.coded
        assert psnr(truth.diffuse, truth.image) == pytest.approx(
            anchors[name]["input_baseline"]["psnr"], abs=1e-5
        )


@pytest.mark.parametrize("name", TRAINING_OBJECTS)
def test_laboratory_layers_add_up(shared: Path, name: str) -> None:
    truth = load_laboratory(shared / "data" / "mit_berkeley_train", name)
    assert_fits(truth)
    assert not truth.mask.all() and not truth.coded
    gap = np.abs(truth.image - truth.diffuse - truth.specular)[truth.mask].max(axis=1)
    # Of cup1 and panther the sensor was full at a few pixels.
    assert (gap < 2 / 65535).mean() > (0.998 if name in ("cup1", "panther") else 0.9999999)
    if name == "apple":
        assert mse(truth.diffuse, truth.image, truth.mask) == pytest.approx(2.104118e-4, rel=1e-5)


def test_rendered_scenes_are_read_in_both_forms(tmp_path: Path) -> None:
    scene = ball()
    for file in ("maps.exr", "truth.exr"):
        folder = tmp_path / file
        folder.mkdir()
        layers = {
            f"{name}.{c}": getattr(scene, name)[..., i]
            for name in ("image", "diffuse")
            for i, c in enumerate("RGB")
        }
        write_channels(folder / file, layers | {"mask.A": scene.mask.astype(np.float32)})
    plain = tmp_path / "plain"
    plain.mkdir()
    for name in ("image", "diffuse"):
        write_channels(
            plain / f"{name}.exr", {c: getattr(scene, name)[..., i] for i, c in enumerate("RGB")}
        )
    write_image(plain / "mask.png", np.where(scene.mask, 255, 0).astype(np.uint8))
    for folder in tmp_path.iterdir():
        truth = load_rendered(folder)
        assert_fits(truth)
        assert truth.name == folder.name and np.array_equal(truth.mask, scene.mask)
        assert np.allclose(truth.specular, scene.specular, atol=1e-6)


def test_pixels_at_full_scale_are_clipped_and_brighter_ones_are_not(tmp_path: Path) -> None:
    image = np.full((4, 4, 3), 0.5)
    image[0, 0, 1], image[1, 1] = 1, 3
    layers = {
        f"{name}.{c}": image[..., i] for name in ("image", "diffuse") for i, c in enumerate("RGB")
    }
    write_channels(tmp_path / "maps.exr", layers | {"mask.A": np.ones((4, 4))})
    assert np.argwhere(load_rendered(tmp_path).clipped).tolist() == [[0, 0]]


def test_what_is_no_scene_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a rendered scene"):
        load_rendered(tmp_path)
    write_channels(tmp_path / "maps.exr", {f"image.{c}": np.ones((4, 4)) for c in "RGB"})
    with pytest.raises(InputError, match="lacks the channel diffuse.R"):
        load_rendered(tmp_path)
    write_image(tmp_path / "a.bmp", np.ones((9, 9, 3), np.uint8))
    write_image(tmp_path / "a_gt.bmp", np.ones((9, 8, 3), np.uint8))
    with pytest.raises(InputError, match="differ in size"):
        load_shen_zheng(tmp_path, "a")
    with pytest.raises(InputError, match="no such file"):
        load_laboratory(tmp_path, "apple")
