"""Mallick et al. 2006: figures, a hill that erosion must level exactly, and what must not matter."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.separation.published import mallick_2006
from isc_core.separation.published.mallick_2006 import VARIANTS, Mallick2006Options
from tests.core.separation.scenes import assert_layers_hold, read


def plate(radius: float = 5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true diffuse (both (H, W, 3)) and mask of two shaded paints side by side with a white
    highlight on each.
    """
    y, x = np.mgrid[:50, :90].astype(float)
    specular = sum(0.4 * np.clip(1 - np.hypot(x - at, y - 25) / radius, 0, 1) for at in (22, 67))
    paint = np.where((x < 45)[..., None], [0.7, 0.3, 0.1], [0.2, 0.3, 0.6])
    diffuse = paint * (0.6 + 0.4 * y / 50)[..., None]
    return diffuse + specular[..., None], diffuse, np.ones(y.shape, bool)


FIGURES = [
    ("animals", "paper", 33.6),
    ("cups", "paper", 35.1),
    ("animals", "improved", 38.6),
    ("cups", "improved", 36.8),
]


@pytest.mark.parametrize(("name", "variant", "psnr"), FIGURES)
def test_figures(shared: Path, name: str, variant: str, psnr: float) -> None:
    image, truth = (
        read(shared / "data/highlight" / file) for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    split = mallick_2006.separate(image, np.ones(image.shape[:2], bool), VARIANTS[variant])
    assert -10 * np.log10(np.mean((split.diffuse - truth) ** 2)) == pytest.approx(psnr, abs=0.1)


@pytest.mark.parametrize(
    ("name", "at_most"), [("apple", 0.65), ("teabag2", 1.001), ("squirrel", 1.001)]
)
def test_improved_helps_or_leaves_alone(shared: Path, name: str, at_most: float) -> None:
    folder = shared / "data/mit_berkeley_train/laboratory" / name
    image, truth = read(folder / "original.png"), read(folder / "diffuse.png")
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    errors = {}
    for variant, options in VARIANTS.items():
        split = mallick_2006.separate(image, mask, options)
        assert_layers_hold(split, image, mask)
        errors[variant] = np.mean((split.diffuse - truth)[mask] ** 2) / np.mean(
            (image - truth)[mask] ** 2
        )
    assert errors["improved"] <= at_most < errors["paper"]


@pytest.mark.parametrize(("variant", "left"), [("paper", 0.02), ("improved", 0.1)])
def test_highlights_on_two_paints_are_eroded(variant: str, left: float) -> None:
    image, diffuse, mask = plate()
    split = mallick_2006.separate(image, mask, VARIANTS[variant])
    assert_layers_hold(split, image, mask)
    assert np.mean((split.diffuse - diffuse) ** 2) <= left * np.mean((image - diffuse) ** 2)


def test_highlights_of_large_photos_go_as_well() -> None:
    """720 pixels wide, highlights of 24 pixels' radius: more than the steps reach, but not on
    averages over 2 x 2 pixels.
    """
    image, diffuse, mask = (
        np.repeat(np.repeat(array, 8, axis=0), 8, axis=1) for array in plate(radius=3)
    )
    left = {}
    for longest in (640, None):
        split = mallick_2006.separate(image, mask, Mallick2006Options(longest=longest))
        assert_layers_hold(split, image, mask)
        left[longest] = np.mean((split.diffuse - diffuse) ** 2) / np.mean((image - diffuse) ** 2)
    assert left[640] < 0.05 and left[640] < 0.4 * left[None]
    padded = np.pad(image, [(3, 5), (11, 2), (0, 0)], constant_values=np.nan)
    wide = mallick_2006.separate(padded, np.pad(mask, [(3, 5), (11, 2)]))
    assert np.allclose(
        wide.diffuse[3:-5, 11:-2], mallick_2006.separate(image, mask).diffuse, atol=1e-6
    )


def test_an_image_of_one_angle_is_a_steady_state() -> None:
    _, diffuse, mask = plate()
    for options in VARIANTS.values():
        split = mallick_2006.separate(diffuse[:, :45], mask[:, :45], options)
        assert split.specular.max() <= 1e-5


def test_erosion_reaches_as_far_as_its_steps() -> None:
    image, diffuse, mask = plate(radius=14)
    before = np.mean((image - diffuse) ** 2)
    left = [
        np.mean(
            (
                mallick_2006.separate(
                    image, mask, Mallick2006Options(steps=n, restoring_steps=0)
                ).diffuse
                - diffuse
            )
            ** 2
        )
        / before
        for n in (0, 10, 40)
    ]
    assert left[0] == pytest.approx(1) and left[1] < 0.8 and left[2] < 0.3


def test_an_opening_keeps_what_erosion_takes_from_a_slope() -> None:
    y, x = np.mgrid[:40, :60].astype(float)
    slope = np.stack([0.6 + 0 * x, 0.3 + 0.003 * x, 0.1 + 0.003 * x], axis=2)
    mask = np.ones(y.shape, bool)
    lost = [
        mallick_2006.separate(
            slope, mask, Mallick2006Options(steps=10, restoring_steps=n, fade=None)
        )
        .specular[:, 12:-12]
        .mean()
        for n in (0, 5, 10)
    ]
    assert lost[0] > 1.5 * lost[1] > 0 and lost[2] < 0.1 * lost[0]


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_scale_and_surroundings_do_not_matter(variant: str) -> None:
    image, _, mask = plate()
    mask[:, 80:] = False
    split = mallick_2006.separate(image, mask, VARIANTS[variant])
    padded = np.pad(
        np.where(mask[..., None], image, np.nan), [(6, 9), (8, 7), (0, 0)], constant_values=np.inf
    )
    wide = mallick_2006.separate(1000 * padded, np.pad(mask, [(6, 9), (8, 7)]), VARIANTS[variant])
    assert np.allclose(wide.diffuse[6:-9, 8:-7], 1000 * split.diffuse, rtol=1e-4, atol=1e-2)


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_any_mask_noise_and_grey_patches_keep_the_layers_sound(variant: str) -> None:
    random = np.random.default_rng(3)
    image = random.random((40, 50, 3)) ** 3
    image[10:20] = image[10:20, :, :1]
    image[5:8] = 0
    single = np.zeros((40, 50), bool)
    single[3, 4] = True
    for mask in (random.random((40, 50)) > 0.4, single):
        split = mallick_2006.separate(
            np.where(mask[..., None], image, np.nan), mask, VARIANTS[variant]
        )
        assert_layers_hold(split, np.where(mask[..., None], image, 0), mask)
        assert not split.specular[10:20].any()  # grey has no hue: nothing there moves


def test_clipped_cores_are_filled_from_around() -> None:
    scene, diffuse, mask = plate()
    image = np.minimum(scene, 0.8)
    clipped = (scene > 0.8).any(axis=2)
    split = mallick_2006.separate(image, mask, clipped=clipped)
    assert_layers_hold(split, image, mask)
    assert not split.confidence[clipped].any()
    assert np.mean((split.diffuse - diffuse)[clipped] ** 2) < 0.2 * np.mean(
        (image - diffuse)[clipped] ** 2
    )
    everything = mallick_2006.separate(image, mask, clipped=mask)
    assert not everything.specular.any()


def test_progress_and_cancel() -> None:
    image, _, mask = plate()
    heard: list[float] = []
    mallick_2006.separate(image, mask, monitor=Monitor(lambda event: heard.append(event.fraction)))
    assert heard == sorted(heard) and heard[0] >= 0 and heard[-1] <= 1
    with pytest.raises(Cancelled):
        mallick_2006.separate(image, mask, monitor=Monitor(cancelled=lambda: True))


def test_refuses_what_it_cannot_use() -> None:
    image, _, mask = plate()
    with pytest.raises(InputError, match="no colour"):
        mallick_2006.separate(np.repeat(image[..., :1], 3, axis=2), mask)
    wrong = [
        ("steps", -1),
        ("step", 0.8),
        ("restoring_steps", -1),
        ("smoothing", -1),
        ("edge", np.nan),
        ("chroma", 0),
        ("texture", 0),
    ]
    for name, value in [*wrong, ("bright_saturation", 2), ("fade", 0), ("longest", 8)]:
        with pytest.raises(InputError, match=name):
            mallick_2006.separate(image, mask, Mallick2006Options(**{name: value}))
