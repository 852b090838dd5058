"""The demo's render: its photo, the direction of its light, and the content of its files."""

from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.io.exr import read_channels
from synth.capture.truth import GroundTruth
from synth.demo_scene import demo_object, main, soft_environment


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    return demo_object(64, 32)


@pytest.mark.slow
def test_the_photo_shows_highlights_and_is_exposed(truth: GroundTruth) -> None:
    share = truth.specular[truth.mask].max(-1) / truth.image[truth.mask].max(-1)
    assert (share > 0.5).mean() > 0.01
    assert np.median(share) < 0.3
    assert 0.5 < np.quantile(truth.image[truth.mask], 0.995) <= 0.95


@pytest.mark.slow
def test_light_from_above_left_falls_there(truth: GroundTruth) -> None:
    """Lights and image share one frame: the window of the environment and the key light are on
    their sides.
    """
    shading = truth.shading.mean(-1)
    up_left = (truth.normal[..., 0] < -0.4) & (truth.normal[..., 1] > 0.2) & truth.mask
    down_right = (truth.normal[..., 0] > 0.4) & (truth.normal[..., 1] < -0.2) & truth.mask
    assert shading[up_left].mean() > 1.3 * shading[down_right].mean()


def test_the_environment_is_positive_and_brighter_above() -> None:
    sky = soft_environment(32)
    assert sky.shape == (32, 64, 3)
    assert sky.min() > 0
    assert sky[:8].mean() > 1.5 * sky[-8:].mean()


@pytest.mark.slow
def test_the_command_writes_both_files_and_replaces_its_own(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    for _ in range(2):
        assert main(["-o", str(folder), "--size", "32", "--samples", "4"]) == 0
    photo = cv2.imread(str(folder / "photo.png"), cv2.IMREAD_UNCHANGED)
    assert photo.shape == (32, 32, 4)
    assert photo.dtype == np.uint16
    channels = read_channels(folder / "truth.exr")
    assert {
        "image.R",
        "diffuse.G",
        "specular.B",
        "reflectance.R",
        "shading.R",
        "normal.Z",
        "height.Z",
        "mask.A",
    } <= set(channels)
    np.testing.assert_array_equal(channels["mask.A"] > 0.5, photo[..., 3] > 0)
    coded = photo[..., 2] / 65535  # the red channel of a file in the order blue, green, red
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(linear, np.clip(channels["image.R"], 0, 1), atol=1e-4)


def test_the_command_refuses_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert main(["-o", str(tmp_path), "--size", "32"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert main(["-o", str(tmp_path / "new"), "--size", "2"]) == 2
