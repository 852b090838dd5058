"""What a camera and a file do to a picture."""

import io

import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from PIL import Image

from training.world.camera import (
    CameraDraw,
    decoded_srgb,
    draw_camera,
    encoded_srgb,
    exposed,
    photographed,
    through_jpeg,
)

PLAIN = CameraDraw(1, 0, 0, 0, 0, 0, 0, 0, 0)


def picture(side: int = 64) -> torch.Tensor:
    """Smooth colours with an edge and some grain, (1, 3, side, side) in [0, 1]."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:side, :side] / side
    layers = [0.5 + 0.4 * np.sin(6 * x + k) * np.cos(5 * y - k) for k in range(3)]
    image = np.stack(layers) + 0.15 * (x + y > 1) + rng.normal(0, 0.02, (3, side, side))
    return torch.from_numpy(np.clip(image, 0, 1)[None]).float()


def attributes(draw: CameraDraw) -> dict[str, torch.Tensor]:
    return {name: torch.tensor([value]) * 1.0 for name, value in vars(draw).items()}


@pytest.mark.parametrize("quality", [60, 80, 95])
@pytest.mark.parametrize("subsampled", [0, 1])
def test_files_look_like_pillows(quality: int, subsampled: int) -> None:
    """Less than a level of 255 off on average."""
    eight_bits = (picture() * 255).round()
    mine = through_jpeg(
        eight_bits / 255, torch.tensor([float(quality)]), torch.tensor([float(subsampled)])
    )
    file = io.BytesIO()
    pixels = eight_bits[0].permute(1, 2, 0).numpy().astype(np.uint8)
    Image.fromarray(pixels).save(file, "JPEG", quality=quality, subsampling=2 * subsampled)
    theirs = np.asarray(Image.open(file), float).transpose(2, 0, 1)
    off = np.abs(mine[0].numpy() * 255 - theirs).mean()
    assert off < 1
    assert off < 0.3 * np.abs(theirs - eight_bits[0].numpy()).mean()


def test_srgb_there_and_back() -> None:
    light = torch.linspace(0, 1, 1001)
    torch.testing.assert_close(decoded_srgb(encoded_srgb(light)), light, rtol=1e-4, atol=1e-6)
    assert encoded_srgb(torch.tensor(0.5)).item() == pytest.approx(0.7353569, abs=1e-6)
    assert (encoded_srgb(light).diff() > 0).all()


def test_a_camera_that_does_nothing_changes_nothing() -> None:
    light, mask = 1.5 * picture(), torch.ones(1, 1, 64, 64)
    torch.testing.assert_close(photographed(light, mask, attributes(PLAIN)), light)
    clipped = photographed(light, mask, attributes(CameraDraw(1, 0, 0, 0, 0, 0, 0, 0, 1)))
    torch.testing.assert_close(clipped, light.clamp(max=1))


def test_a_file_of_high_quality_keeps_the_light() -> None:
    light, mask = picture(), torch.ones(1, 1, 64, 64)
    filed = photographed(light, mask, attributes(CameraDraw(1, 0, 0, 0, 0, 0, 100, 0, 1)))
    assert (filed - light).abs().max() < 0.04 and (filed - light).abs().mean() < 0.006


@pytest.mark.parametrize(
    "camera",
    [
        CameraDraw(1, 0.9, 0, 0, 0, 0, 0, 0, 0),
        CameraDraw(1, 0, 0, 0, 0.8, 0, 0, 0, 0),
    ],
)
def test_neither_blur_nor_sharpening_mixes_in_the_background(camera: CameraDraw) -> None:
    light, mask = picture(), torch.zeros(1, 1, 64, 64)
    mask[..., 10:50, 20:40] = 1
    bright = torch.where(mask > 0, light, 100.0)
    seen, alone = (photographed(one, mask, attributes(camera)) for one in (bright, light * mask))
    torch.testing.assert_close(seen * mask, alone * mask)
    assert (seen - light)[mask.expand_as(light) > 0].abs().max() > 0.01
    even = photographed(torch.full_like(light, 0.3), mask, attributes(camera))
    torch.testing.assert_close(even, torch.full_like(light, 0.3))


def test_exposure_is_that_of_the_brightest_hundredth_of_the_object() -> None:
    light, mask = picture(), torch.zeros(1, 1, 64, 64)
    mask[..., 10:50, 20:40] = 1
    light[..., 0, 0] = 1000
    gain = exposed(light, mask, torch.tensor([0.7]))
    bright = (light * gain).amax(1, keepdim=True)[mask > 0]
    assert bright.sort().values[-8].item() == pytest.approx(0.7, rel=1e-5)
    assert exposed(0 * light, mask, torch.tensor([0.7])).isfinite().all()


def test_noise_grows_with_the_light() -> None:
    torch.manual_seed(0)
    light = torch.cat([torch.full((1, 3, 64, 32), 0.1), torch.full((1, 3, 64, 32), 0.8)], 3)
    noisy = photographed(
        light, torch.ones(1, 1, 64, 64), attributes(CameraDraw(1, 0, 0.05, 0.01, 0, 0, 0, 0, 0))
    )
    for half, level in ((noisy[..., :32], 0.1), (noisy[..., 32:], 0.8)):
        assert half.std().item() == pytest.approx(0.05 * level + 0.01, rel=0.05)
        assert half.mean().item() == pytest.approx(level, rel=0.01)


def test_cameras_are_as_they_say() -> None:
    rng = np.random.default_rng(0)
    for plain in (False, True):
        for _ in range(50):
            one = draw_camera(rng, plain)
            assert 0.3 < one.exposure < 1.7 and 0 <= one.blur < 1 and 0 < one.noise < 0.06
            assert one.quality == 0 or (60 <= one.quality <= 95 and not plain)
