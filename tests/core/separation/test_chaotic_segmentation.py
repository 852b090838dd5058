"""Chaotic Segmentation: measured gains, the layers' identities, what it must leave alone, and its
options.
"""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from isc_core.separation.chaotic_segmentation import (
    VARIANTS,
    ChaoticSegmentationOptions,
    find_specular,
    separate,
)
from tests.core.separation.scenes import assert_layers_hold, read

PAPER = VARIANTS["paper"]


def glossy_scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true specular (H, W) and mask.

    A shaded disc of two albedos under white light, with one highlight over both.
    """
    y, x = np.mgrid[-1:1:90j, -1:1:110j]
    mask = x**2 + y**2 < 0.9
    shading = 0.4 + 0.6 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    specular = 0.5 * np.exp(-((x - 0.05) ** 2 + (y + 0.2) ** 2) / 0.02)
    albedo = np.where((x > 0)[..., None], [0.7, 0.25, 0.15], [0.2, 0.6, 0.15])
    return (
        (albedo * shading[..., None] + specular[..., None]) * mask[..., None],
        specular * mask,
        mask,
    )


def ratio(split: Separation, image: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float:
    return float(np.mean((split.diffuse - truth)[mask] ** 2) / np.mean((image - truth)[mask] ** 2))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "improved", "paper"), [("animals", 0.2, 0.65), ("cups", 0.26, 0.55)]
)
def test_gains_on_photos_with_truth(shared: Path, name: str, improved: float, paper: float) -> None:
    image, truth = (
        read(shared / "data/highlight" / file) for file in (f"{name}.bmp", f"{name}_gt.bmp")
    )
    mask = np.ones(image.shape[:2], bool)
    ours, published = separate(image, mask), separate(image, mask, PAPER)
    assert_layers_hold(ours, image, mask, tinted=True)
    assert_layers_hold(published, image, mask, tinted=True)
    assert ratio(ours, image, truth, mask) < improved
    assert ratio(published, image, truth, mask) < paper


@pytest.mark.parametrize(("name", "limit"), [("apple", 0.25), ("teabag2", 1.0), ("paper1", 1.0)])
def test_laboratory_objects_do_not_get_worse(shared: Path, name: str, limit: float) -> None:
    folder = shared / "data/mit_berkeley_train/laboratory" / name
    image, truth = read(folder / "original.png"), read(folder / "diffuse.png")
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    assert ratio(separate(image, mask), image, truth, mask) <= limit + 1e-6


def test_recovers_a_rendered_highlight_across_a_border_of_paints() -> None:
    image, specular, mask = glossy_scene()
    split = separate(image, mask)
    assert_layers_hold(split, image, mask, tinted=True)
    assert np.ptp(split.specular, axis=2).max() == 0
    assert np.mean((split.specular[..., 0] - specular)[mask] ** 2) < 0.05 * np.mean(
        specular[mask] ** 2
    )


def test_a_matte_scene_stays_as_it_is() -> None:
    image, specular, mask = glossy_scene()
    matte = image - specular[..., None]
    change = separate(matte, mask).specular
    assert np.sqrt(np.mean(change[mask] ** 2)) < 0.005 * np.sqrt(np.mean(matte[mask] ** 2))


@pytest.mark.parametrize("options", VARIANTS.values(), ids=VARIANTS)
def test_scale_and_what_lies_outside_do_not_matter(options: ChaoticSegmentationOptions) -> None:
    image, _, mask = glossy_scene()
    split = separate(image, mask, options)
    other = separate(np.where(mask[..., None], 1024 * image, np.nan), mask, options)
    assert np.allclose(other.diffuse, 1024 * split.diffuse, atol=1e-2)
    assert np.array_equal(separate(image, mask, options).diffuse, split.diffuse)


@pytest.mark.parametrize("optimiser", ["clonal_selection", "particle_swarm", "exact"])
def test_every_optimiser_finds_the_same_pixels(optimiser: str) -> None:
    image, _, mask = glossy_scene()
    for levels in (1, 2, 3):
        chaotic = find_specular(image, mask, replace(PAPER, levels=levels))
        assert chaotic.any() and np.array_equal(
            find_specular(image, mask, replace(PAPER, levels=levels, optimiser=optimiser)), chaotic
        )


def test_more_levels_and_higher_thresholds_find_less() -> None:
    image, _, mask = glossy_scene()
    one, three = (find_specular(image, mask, replace(PAPER, levels=k)) for k in (1, 3))
    assert three.sum() < one.sum() and not (three & ~one).any()
    low, high = (find_specular(image, mask, replace(PAPER, threshold=t)) for t in (0.4, 0.8))
    least = image.min(axis=2)
    assert np.array_equal(high, mask & (least > 0.8 * least[mask].max())) and low.sum() > high.sum()


def test_clipped_pixels_are_no_source() -> None:
    image, specular, mask = glossy_scene()
    clipped = (image >= 0.8).any(axis=2) & mask
    recorded = np.minimum(image, 0.8)
    for options in VARIANTS.values():
        split = separate(recorded, mask, options, clipped)
        assert_layers_hold(split, recorded, mask, tinted=True)
        assert not split.confidence[clipped].any() and not split.residual[~clipped].any()
    truth = image - specular[..., None]
    ours = separate(recorded, mask, clipped=clipped)
    assert ratio(ours, recorded, truth, mask) < 0.3


@pytest.mark.parametrize("shape", [(1, 1), (3, 30), (9, 9)])
@pytest.mark.parametrize("options", VARIANTS.values(), ids=VARIANTS)
def test_little_objects(options: ChaoticSegmentationOptions, shape: tuple[int, int]) -> None:
    image = np.random.default_rng(1).random((*shape, 3)) + [0.2, 0.1, 0]
    mask = np.ones(shape, bool)
    assert_layers_hold(separate(image, mask, options), image, mask, tinted=True)


def test_grey_photos() -> None:
    ramp = np.broadcast_to(np.linspace(0.2, 1, 40)[None, :, None], (30, 40, 3))
    mask = np.ones((30, 40), bool)
    with pytest.raises(InputError, match="no colour"):
        separate(ramp, mask)
    assert_layers_hold(separate(ramp, mask, PAPER), ramp, mask, tinted=True)
    flat = np.full((30, 40, 3), 0.5)
    assert (
        not separate(flat, mask, PAPER).specular.any()
        and not separate(np.zeros_like(flat), mask, PAPER).specular.any()
    )


def test_stops_when_asked() -> None:
    image, _, mask = glossy_scene()
    seen: list[float] = []
    separate(image, mask, monitor=Monitor(lambda event: seen.append(event.fraction)))
    assert seen == sorted(seen) and len(seen) > 2
    with pytest.raises(Cancelled):
        separate(image, mask, monitor=Monitor(cancelled=lambda: len(seen) > 0))


@pytest.mark.parametrize(
    "change",
    [
        {"levels": 0},
        {"levels": 17},
        {"optimiser": "luck"},
        {"threshold": 1.0},
        {"threshold": 0.0},
        {"threshold": float("nan")},
    ]
    + [{"rim": -0.1}, {"seed": -1}, {"evaluations": 0}, {"repaint": "gold"}],
)
def test_refuses_options_out_of_range(change: dict[str, object]) -> None:
    image, _, mask = glossy_scene()
    with pytest.raises(InputError, match=next(iter(change))):
        separate(image, mask, replace(VARIANTS["improved"], **change))
