"""The demo's render against physics: what the files hold, and that its layers are the light's."""

from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.exr import read_channels
from synth.demo_scene import demo_lights, demo_object, main
from synth.gourd import gourd, painted_skin
from synth.ground_truth import GroundTruth, Material, View, diffuse_lobe, render, render_lit, specular_lobe
from synth.lighting import soft_sky
from synth.meshes import swept, write_ply
from synth.variant import load_mitsuba

VIEW = View(size=64, samples=64)


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    return demo_object(VIEW)


def test_every_map_is_finite_and_empty_outside_the_mask(truth: GroundTruth) -> None:
    assert 0.2 < truth.mask.mean() < 0.7
    for name in ("image", "diffuse", "specular", "reflectance", "shading", "height"):
        layer = getattr(truth, name)
        assert np.isfinite(layer).all(), name
        assert not layer[~truth.mask].any(), name
    assert (truth.normal[~truth.mask] == (0, 0, 1)).all()
    assert (truth.normal[truth.mask][:, 2] > 0).all()


def test_the_photo_shows_highlights_and_is_exposed(truth: GroundTruth) -> None:
    share = truth.specular[truth.mask].max(-1) / truth.image[truth.mask].max(-1)
    assert (share > 0.5).mean() > 0.01
    assert np.median(share) < 0.3
    assert 0.5 < np.quantile(truth.image[truth.mask], 0.995) <= 0.95


def test_diffuse_is_reflectance_times_shading_away_from_painted_edges(truth: GroundTruth) -> None:
    error = np.abs(truth.diffuse - truth.reflectance * truth.shading)[truth.mask].max(-1) / truth.diffuse.max()
    assert np.median(error) < 1e-3


def test_normals_are_those_of_the_height(truth: GroundTruth) -> None:
    rows, columns = np.gradient(truth.height)
    slopes = np.dstack([-columns, rows, np.ones_like(rows)])
    slopes /= np.linalg.norm(slopes, axis=-1, keepdims=True)
    inner = cv2.erode(truth.mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    angle = np.degrees(np.arccos(np.clip((slopes * truth.normal).sum(-1), -1, 1)))[inner]
    assert np.median(angle) < 3


def test_the_layers_add_up_to_the_whole_material(truth: GroundTruth, tmp_path: Path) -> None:
    """An independent render of both lobes in one BSDF, held against the sum of the layers by the noise that two such renders show."""
    ply = tmp_path / "gourd.ply"
    write_ply(ply, gourd().turned(14))
    material, lights = Material(painted_skin()), demo_lights()
    # A blend halves each of its parts.
    blend = {"type": "blendbsdf", "weight": 0.5, "d": diffuse_lobe(material.albedo), "s": specular_lobe(material)}
    first, second = (2 * render_lit(ply, blend, lights, View(size=64, samples=64, seed=seed))[0][truth.mask] for seed in (1, 2))
    summed = render(gourd().turned(14), material, lights, VIEW).image[truth.mask]
    noise = np.abs(first - second).mean()
    assert np.abs(summed - first).mean() < 1.5 * noise
    np.testing.assert_allclose(summed.mean(0), first.mean(0), rtol=0.01)


def test_a_white_sphere_in_a_white_sky_shades_to_one() -> None:
    """The white furnace: radiance 1 from everywhere on a convex Lambertian body of albedo 1 gives 1 everywhere."""
    mi = load_mitsuba()
    polar, angle = np.linspace(0, np.pi, 61)[:, None], np.linspace(0, 2 * np.pi, 121)[None]
    ball = swept(np.stack([np.sin(polar) * np.sin(angle), np.broadcast_to(np.cos(polar), (61, 121)), np.sin(polar) * np.cos(angle)], -1))
    sky = {"sky": {"type": "envmap", "bitmap": mi.Bitmap(np.ones((16, 32, 3), np.float32))}}
    truth = render(ball, Material(np.full((4, 4, 3), 0.5, np.float32)), sky, View(size=32, extent=2.2, samples=64))
    np.testing.assert_allclose(truth.shading[truth.mask].mean(), 1, rtol=0.02)
    np.testing.assert_allclose(truth.reflectance[truth.mask], 0.5, rtol=1e-5)
    rows, columns = np.indices((32, 32)) + 0.5
    x, y = (columns - 16) * 2.2 / 32, (16 - rows) * 2.2 / 32
    depth = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    np.testing.assert_allclose(truth.normal[truth.mask], np.dstack([x, y, depth])[truth.mask], atol=0.03)
    np.testing.assert_allclose(truth.height[truth.mask], depth[truth.mask] * 32 / 2.2, atol=0.3)


def test_light_from_above_left_falls_there() -> None:
    """The frame of the lights is the frame of the image: the window of the sky and the key light are on their sides."""
    truth = demo_object(View(size=48, samples=16))
    shading = truth.shading.mean(-1)
    up_left = (truth.normal[..., 0] < -0.4) & (truth.normal[..., 1] > 0.2) & truth.mask
    down_right = (truth.normal[..., 0] > 0.4) & (truth.normal[..., 1] < -0.2) & truth.mask
    assert shading[up_left].mean() > 1.3 * shading[down_right].mean()


def test_the_sky_is_positive_and_brighter_than_the_ground() -> None:
    sky = soft_sky(32)
    assert sky.shape == (32, 64, 3)
    assert sky.min() > 0
    assert sky[:8].mean() > 1.5 * sky[-8:].mean()


def test_the_command_writes_both_files_and_replaces_its_own(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    for _ in range(2):
        assert main(["-o", str(folder), "--size", "32", "--samples", "4"]) == 0
    photo = cv2.imread(str(folder / "photo.png"), cv2.IMREAD_UNCHANGED)
    assert photo.shape == (32, 32, 4)
    assert photo.dtype == np.uint16
    channels = read_channels(folder / "truth.exr")
    assert {"image.R", "diffuse.G", "specular.B", "reflectance.R", "shading.R", "normal.Z", "height.Z", "mask.A"} <= set(channels)
    np.testing.assert_array_equal(channels["mask.A"] > 0.5, photo[..., 3] > 0)
    coded = photo[..., 2] / 65535  # the red channel of a file in the order blue, green, red
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(linear, np.clip(channels["image.R"], 0, 1), atol=1e-4)


def test_the_command_refuses_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert main(["-o", str(tmp_path), "--size", "32"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert main(["-o", str(tmp_path / "new"), "--size", "2"]) == 2
