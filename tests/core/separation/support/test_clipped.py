"""Clipped pixels: the core of a highlight is filled from around it, a bright albedo stays."""

from pathlib import Path

import numpy as np
import pytest

from isc_core.photo import WholeFrame, read_photo
from isc_core.scene.decomposition import Separation
from isc_core.separation import separate
from isc_core.separation.support.layers import white_layers
from tests.core.separation.scenes import glossy_disc, highlight_photo, psnr


def clipped_disc(gain: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Recorded image, true diffuse, true specular (H, W), mask and clipped map of a disc with
    highlights, full at 1.
    """
    image, diffuse, mask = glossy_disc()
    bright = gain * image
    return (
        np.minimum(bright, 1),
        gain * diffuse,
        gain * (image - diffuse)[..., 0],
        mask,
        (bright >= 1).any(axis=2),
    )


def explained(specular: np.ndarray, gain: float) -> tuple[Separation, np.ndarray, np.ndarray]:
    """The split of the clipped disc where `specular` was found outside the clipped pixels, with the
    image and the clipped map.
    """
    image, _, _, mask, clipped = clipped_disc(gain)
    return white_layers(image, mask, np.where(clipped, 0, specular), clipped), image, clipped


@pytest.mark.parametrize("gain", [1.1, 1.6])
def test_cores_of_highlights_are_recovered(gain: float) -> None:
    image, diffuse, specular, mask, clipped = clipped_disc(gain)
    assert clipped.sum() > 50
    split, _, _ = explained(specular, gain)
    assert (
        np.sqrt(np.mean((split.specular[..., 0] - specular)[clipped] ** 2)) < 0.15 * specular.max()
    )
    assert np.abs(split.diffuse - np.minimum(diffuse, 1))[clipped].mean() < 0.06
    total = split.diffuse + split.specular + split.residual
    assert np.abs(total - image)[mask].max() < 1e-6 and not split.confidence[clipped].any()
    assert split.residual.max() <= 0 and split.residual.min() < -0.05
    assert not split.residual[image < 0.95].any(), "only a full channel has lost light"


def test_full_channels_of_strong_paint_are_no_highlight() -> None:
    """Red albedo, full in the light, of which the method removed nothing."""
    y, x = np.mgrid[-1:1:60j, -1:1:60j]
    shading = 1.5 * np.exp(-(x**2) - y**2) + 0.1 * np.sin(40 * x) * np.sin(40 * y)
    image = np.minimum(shading[..., None] * np.array([1.0, 0.3, 0.1]), 1)
    clipped = image[..., 0] == 1
    assert 300 < clipped.sum() < 1800
    split = white_layers(image, np.ones((60, 60), bool), np.zeros((60, 60)), clipped)
    assert np.array_equal(split.diffuse, image.astype(np.float32))
    assert not split.specular.any() and not split.residual.any()
    assert not split.confidence[clipped].any() and split.confidence[~clipped].all()


def test_full_white_speaks_for_itself() -> None:
    split, image, clipped = explained(np.zeros((96, 120)), 1.6)
    white = clipped & (image.min(axis=2) > 0.85)
    albedo = clipped & (image.min(axis=2) < 0.6)
    assert white.sum() > 20 and albedo.sum() > 20
    assert split.specular[white].min() > 0.1 and not split.specular[albedo].any()


@pytest.mark.parametrize("method", ["tan_2005", "yang_2010", "mallick_2006", "shen_2013"])
def test_knowing_what_is_clipped_does_no_harm(shared: Path, method: str) -> None:
    photo = read_photo(
        shared / "data/highlight/animals.bmp",
        transfer="linear",
        whole_frame=WholeFrame.WITHOUT_MASK,
    )
    truth = highlight_photo(shared, "animals")[1]
    assert photo.clipped.any()
    blind, told = (
        psnr(separate(method, photo.image, photo.mask, clipped), truth)
        for clipped in (None, photo.clipped)
    )
    assert told >= blind - 0.02


@pytest.mark.parametrize("name", ["Basketball", "GlueGun"])
def test_photos_of_strong_paint_get_no_specks(shared: Path, name: str) -> None:
    photo = read_photo(shared / f"data/photos/{name}.png")
    strong = photo.clipped & (photo.image.min(axis=2) < 0.6 * photo.image.max(axis=2))
    assert strong.any()
    split = white_layers(photo.image, photo.mask, np.zeros(photo.mask.shape), photo.clipped)
    assert not split.specular[strong].any()
