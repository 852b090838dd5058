"""Shen & Cai 2009: published figures, the exact gain of a made scene, and what must not matter."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.separation.published import shen_2009
from isc_core.separation.published.shen_2009 import VARIANTS, Shen2009Options
from tests.core.separation.scenes import assert_layers_hold, read


def spots(heights: tuple[float, ...] = (0.3, 0.4)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true diffuse (both (H, W, 3)) and mask of an even orange plate with round white
    highlights in a row.
    """
    y, x = np.mgrid[:60, : 60 * len(heights)].astype(float)
    specular = sum(
        h * np.clip(1 - np.hypot(x - 30 - 60 * k, y - 30) / 12, 0, 1) for k, h in enumerate(heights)
    )
    diffuse = np.broadcast_to([0.6, 0.3, 0.1], (*y.shape, 3))
    return diffuse + specular[..., None], diffuse, np.ones(y.shape, bool)


def relative_error(folder: Path, options: Shen2009Options) -> float:
    """Squared error of diffuse inside the object's mask over that of leaving its highlights in."""
    image, truth = read(folder / "original.png"), read(folder / "diffuse.png")
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    split = shen_2009.separate(image, mask, options)
    assert_layers_hold(split, image, mask)
    return float(np.mean((split.diffuse - truth)[mask] ** 2) / np.mean((image - truth)[mask] ** 2))


@pytest.mark.parametrize(
    ("name", "variant", "psnr"),
    [
        ("animals", "sihr", 34.9),
        ("cups", "sihr", 37.6),
        ("animals", "improved", 36.8),
        ("cups", "improved", 37.2),
    ],
)
def test_figures(shared: Path, name: str, variant: str, psnr: float) -> None:
    image, truth = (
        read(shared / "data/highlight" / file) for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    split = shen_2009.separate(image, np.ones(image.shape[:2], bool), VARIANTS[variant])
    assert -10 * np.log10(np.mean((split.diffuse - truth) ** 2)) == pytest.approx(psnr, abs=0.1)


def test_statistics_of_the_mask_are_better_than_those_of_the_frame(shared: Path) -> None:
    apple = shared / "data/mit_berkeley_train/laboratory/apple"
    frame, paper, improved = (
        relative_error(apple, VARIANTS[name]) for name in ("sihr", "paper", "improved")
    )
    assert improved < 0.8 < paper < 2.7 < frame < 7.4


@pytest.mark.parametrize("name", ["squirrel", "teabag2"])
def test_pale_objects_are_left_alone(shared: Path, name: str) -> None:
    folder = shared / "data/mit_berkeley_train/laboratory" / name
    assert relative_error(folder, VARIANTS["improved"]) <= 1 + 1e-3
    assert relative_error(folder, VARIANTS["paper"]) > 40


def test_two_highlights_of_different_height_are_taken_off_a_plate() -> None:
    image, diffuse, mask = spots()
    improved, paper = (
        shen_2009.separate(image, mask, VARIANTS[name]) for name in ("improved", "paper")
    )
    before = np.mean((image - diffuse) ** 2)
    assert np.mean((improved.diffuse - diffuse) ** 2) < 0.02 * before
    assert np.mean((paper.diffuse - diffuse) ** 2) < 0.1 * before


def test_the_gain_makes_colour_continue_across_the_rim() -> None:
    image, _, mask = spots((0.3,))
    split = shen_2009.separate(image, mask, VARIANTS["paper"])
    low = image.min(axis=2)
    excess = np.maximum(low - low.mean() - 0.5 * low.std(ddof=1), 0)
    inside = excess > 0.1 * excess.max()
    ring = ndimage.binary_dilation(inside, np.ones((5, 5))) & ~inside
    jump = split.diffuse[inside].mean(axis=0) - split.diffuse[ring].mean(axis=0)
    assert np.abs(jump).max() < 1e-6
    assert np.allclose(
        split.specular[..., 0] * excess.max(), excess * split.specular.max(), atol=1e-6
    )


@pytest.mark.parametrize("variant", ["improved", "paper"])
def test_scale_and_surroundings_do_not_matter(variant: str) -> None:
    image, _, mask = spots()
    split = shen_2009.separate(image, mask, VARIANTS[variant])
    padded = np.pad(image, [(9, 9), (9, 9), (0, 0)], constant_values=np.nan)
    wide = shen_2009.separate(1000 * padded, np.pad(mask, 9), VARIANTS[variant])
    assert np.allclose(wide.diffuse[9:-9, 9:-9], 1000 * split.diffuse, rtol=1e-5, atol=1e-3)
    assert not wide.diffuse[:9].any()


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_any_mask_and_noise_keep_the_layers_sound(variant: str) -> None:
    random = np.random.default_rng(3)
    image = random.random((40, 50, 3)) ** 3
    single = np.zeros((40, 50), bool)
    single[3, 4] = True
    for mask in (random.random((40, 50)) > 0.4, single):
        for unknown in (np.nan, np.inf):
            split = shen_2009.separate(
                np.where(mask[..., None], image, unknown), mask, VARIANTS[variant]
            )
            assert_layers_hold(split, np.where(mask[..., None], image, 0), mask)


def test_clipped_cores_are_filled_from_around() -> None:
    scene, diffuse, mask = spots((0.5, 0.6))
    image = np.minimum(scene, 0.8)
    clipped = (scene > 0.8).any(axis=2)
    split = shen_2009.separate(image, mask, clipped=clipped)
    assert_layers_hold(split, image, mask)
    assert not split.confidence[clipped].any()
    assert np.mean((split.diffuse - diffuse)[clipped] ** 2) < 0.1 * np.mean(
        (image - diffuse)[clipped] ** 2
    )


def test_refuses_what_it_cannot_use() -> None:
    image, _, mask = spots()
    with pytest.raises(InputError, match="no colour"):
        shen_2009.separate(np.repeat(image[..., :1], 3, axis=2), mask)
    with pytest.raises(InputError, match="mask is empty"):
        shen_2009.separate(image, np.zeros_like(mask))
    for wrong in (Shen2009Options(ring_width=4), Shen2009Options(ring_width=1)):
        with pytest.raises(InputError, match="ring_width"):
            shen_2009.separate(image, mask, wrong)
    for wrong in (
        Shen2009Options(region_share=1),
        Shen2009Options(deviations=np.nan),
        Shen2009Options(bright_saturation=2),
    ):
        with pytest.raises(InputError, match="region_share"):
            shen_2009.separate(image, mask, wrong)
