"""Kim et al. 2013: figures, the exact optima of both steps, and what must not matter."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.separation.published import kim_2013
from isc_core.separation.published.kim_2013 import VARIANTS, Kim2013Options
from tests.core.separation.scenes import assert_layers_hold, read


def plate() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true diffuse (both (H, W, 3)) and mask of two shaded paints side by side with a white
    highlight on each.
    """
    y, x = np.mgrid[:60, :100].astype(float)
    specular = sum(0.4 * np.exp(-((x - at) ** 2 + (y - 30) ** 2) / 60) for at in (25, 75))
    paint = np.where((x < 50)[..., None], [0.7, 0.3, 0.1], [0.2, 0.3, 0.6])
    diffuse = paint * (0.5 + 0.5 * y / 60)[..., None]
    return diffuse + specular[..., None], diffuse, np.ones(y.shape, bool)


def scene_of(image: np.ndarray, options: Kim2013Options) -> kim_2013._Scene:
    mask = np.ones(image.shape[:2], bool)
    return kim_2013._scene(image, mask, float(image.min(axis=2).mean()), options)


FIGURES = [
    ("animals", "paper", 32.7),
    ("cups", "paper", 32.2),
    ("animals", "improved", 38.0),
    ("cups", "improved", 39.7),
]


@pytest.mark.parametrize(("name", "variant", "psnr"), FIGURES)
def test_figures(shared: Path, name: str, variant: str, psnr: float) -> None:
    image, truth = (
        read(shared / "data/highlight" / file) for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    split = kim_2013.separate(image, np.ones(image.shape[:2], bool), VARIANTS[variant])
    assert -10 * np.log10(np.mean((split.diffuse - truth) ** 2)) == pytest.approx(psnr, abs=0.1)


@pytest.mark.parametrize(
    ("name", "at_most"), [("apple", 0.13), ("teabag2", 1.001), ("squirrel", 1.001)]
)
def test_improved_helps_or_leaves_alone(shared: Path, name: str, at_most: float) -> None:
    folder = shared / "data/mit_berkeley_train/laboratory" / name
    image, truth = read(folder / "original.png"), read(folder / "diffuse.png")
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    errors = {}
    for variant, options in VARIANTS.items():
        split = kim_2013.separate(image, mask, options)
        assert_layers_hold(split, image, mask)
        errors[variant] = np.mean((split.diffuse - truth)[mask] ** 2) / np.mean(
            (image - truth)[mask] ** 2
        )
    assert errors["improved"] <= at_most < errors["paper"]


def test_highlights_on_two_paints_go() -> None:
    image, diffuse, mask = plate()
    split = kim_2013.separate(image, mask)
    assert_layers_hold(split, image, mask)
    assert np.mean((split.diffuse - diffuse) ** 2) <= 0.1 * np.mean((image - diffuse) ** 2)


def test_the_dark_channel_comes_first() -> None:
    image = np.random.default_rng(0).random((14, 17, 3))
    options = Kim2013Options(patch=5, base=0.1, rounds=0)
    scene = scene_of(image, options)
    low = image.min(axis=2)
    for y, x in ((0, 0), (7, 9), (13, 4)):
        patch = low[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3]
        assert scene.dark[y, x] == max(patch.min() - 0.1 * low.mean(), 0)
    assert kim_2013._specular_of(scene, options, Monitor()) is scene.dark


def test_the_colour_term_is_least_at_its_target() -> None:
    random = np.random.default_rng(1)
    image = random.random((4, 5, 3)) + 0.3
    paints = random.random((20, 3))
    paints /= np.linalg.norm(paints, axis=1, keepdims=True)
    pull, target = kim_2013._colour_term(scene_of(image, Kim2013Options()), paints)
    for colour, paint, k, s_a, low in zip(
        image.reshape(-1, 3), paints, pull.flat, target.flat, image.min(axis=2).flat, strict=True
    ):
        (_, best), *_ = np.linalg.lstsq(np.stack([paint, np.ones(3)], axis=1), colour, rcond=None)
        assert s_a == pytest.approx(np.clip(best, 0, low), abs=1e-9)

        def misfit(s: float, colour: np.ndarray = colour, paint: np.ndarray = paint) -> float:
            rest = colour - s
            return float(rest @ rest - (rest @ paint) ** 2)

        assert misfit(best + 0.1) - misfit(best) == pytest.approx(0.01 * k)


def test_sweeps_reach_the_least_energy_within_the_bounds() -> None:
    random = np.random.default_rng(2)
    image = random.random((6, 7, 3))
    options = Kim2013Options(sweeps=400)
    scene = scene_of(image, options)
    start, target, pull = random.random((6, 7)), random.random((6, 7)), random.random((6, 7)) + 0.05
    s = kim_2013._smoothed(start, target, pull, scene, options)
    weights = [
        options.smoothness / np.hypot(np.diff(start, axis=axis) / options.gradient, 1)
        for axis in (0, 1)
    ]
    slope = pull * (s - target)
    for axis, weight in enumerate(weights):
        pad = [(1, 1) if k == axis else (0, 0) for k in (0, 1)]
        slope -= np.diff(np.pad(weight * np.diff(s, axis=axis), pad), axis=axis)
    inner = (s > 0) & (s < scene.low)
    assert inner.sum() > 5 and (s == scene.low).sum() > 5
    assert np.abs(slope[inner]).max() < 1e-9
    assert slope[s == scene.low].max() <= 1e-9  # there only a larger s would be better
    assert slope[s == 0].min(initial=0) >= -1e-9


def test_grey_paint_takes_the_specular_light_of_its_surroundings() -> None:
    image = np.full((30, 30, 3), 0.4)
    options = Kim2013Options(sweeps=400)
    scene = scene_of(image, options)
    known = np.ones((30, 30))
    known[12:18, 12:18] = 0  # nothing pulls there
    s = kim_2013._smoothed(np.full((30, 30), 0.2), np.where(known, 0.2, 0.4), known, scene, options)
    assert np.allclose(s, 0.2, atol=1e-6)


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_scale_and_surroundings_do_not_matter(variant: str) -> None:
    image, _, mask = plate()
    mask[:, 90:] = False
    split = kim_2013.separate(image, mask, VARIANTS[variant])
    padded = np.pad(
        np.where(mask[..., None], image, np.nan), [(6, 9), (8, 7), (0, 0)], constant_values=np.inf
    )
    wide = kim_2013.separate(1000 * padded, np.pad(mask, [(6, 9), (8, 7)]), VARIANTS[variant])
    assert np.allclose(wide.diffuse[6:-9, 8:-7], 1000 * split.diffuse, rtol=1e-4, atol=1e-2)


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_any_mask_noise_and_grey_patches_keep_the_layers_sound(variant: str) -> None:
    random = np.random.default_rng(3)
    image = random.random((40, 50, 3)) ** 3
    image[10:20] = image[10:20, :, :1]
    image[5:8] = 0
    single, line = np.zeros((40, 50), bool), np.zeros((40, 50), bool)
    single[3, 4] = True
    line[:, 7] = True
    for mask in (random.random((40, 50)) > 0.4, single, line):
        split = kim_2013.separate(np.where(mask[..., None], image, np.nan), mask, VARIANTS[variant])
        assert_layers_hold(split, np.where(mask[..., None], image, 0), mask)


def test_clipped_cores_are_filled_from_around() -> None:
    scene, diffuse, mask = plate()
    image = np.minimum(scene, 0.8)
    clipped = (scene > 0.8).any(axis=2)
    split = kim_2013.separate(image, mask, clipped=clipped)
    assert_layers_hold(split, image, mask)
    assert not split.confidence[clipped].any()
    assert np.mean((split.diffuse - diffuse)[clipped] ** 2) < 0.2 * np.mean(
        (image - diffuse)[clipped] ** 2
    )
    assert not kim_2013.separate(image, mask, clipped=mask).specular.any()


def test_progress_and_cancel() -> None:
    image, _, mask = plate()
    heard: list[float] = []
    kim_2013.separate(
        image,
        mask,
        Kim2013Options(rounds=3),
        monitor=Monitor(lambda event: heard.append(event.fraction)),
    )
    assert len(heard) == 6 and heard == sorted(heard) and heard[-1] <= 1
    with pytest.raises(Cancelled):
        kim_2013.separate(image, mask, monitor=Monitor(cancelled=lambda: True))


def test_refuses_what_it_cannot_use() -> None:
    image, _, mask = plate()
    with pytest.raises(InputError, match="no colour"):
        kim_2013.separate(np.repeat(image[..., :1], 3, axis=2), mask)
    counts = [("patch", 0), ("rounds", -1), ("sweeps", -1)]
    positive = [
        (name, 0) for name in ("reach", "purity", "trust", "prior", "gradient", "hue", "fade")
    ]
    for name, value in [
        *counts,
        *positive,
        ("base", -1),
        ("smoothness", np.nan),
        ("bright_saturation", 2),
    ]:
        with pytest.raises(InputError, match=name):
            kim_2013.separate(image, mask, Kim2013Options(**{name: value}))
