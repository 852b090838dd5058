"""Akashi & Okatani 2016: published figures, exact minima, the choice of the best start."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from isc_core.progress import Monitor
from isc_core.separation.published import akashi_2016
from isc_core.separation.published.akashi_2016 import VARIANTS, separate
from tests.core.separation.scenes import highlight_photo, laboratory_photo, psnr

RED, GREEN = np.array([0.8, 0.15, 0.1]), np.array([0.1, 0.6, 0.15])
QUICK = replace(VARIANTS["improved"], surface_colours=2, sample=1000)


def glossy_scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, true specular (H, W) and mask.

    A shaded disc of two albedos under white light, with one highlight.
    """
    y, x = np.mgrid[-1:1:60j, -1:1:70j]
    mask = x**2 + y**2 < 0.9
    shading = 0.4 + 0.6 * np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    specular = 0.4 * np.exp(-((x - 0.4) ** 2 + (y + 0.2) ** 2) / 0.03)
    albedo = np.where((x > 0)[..., None], RED, GREEN)
    return (
        (albedo * shading[..., None] + specular[..., None]) * mask[..., None],
        specular * mask,
        mask,
    )


@pytest.mark.slow
@pytest.mark.parametrize(("name", "best"), [("animals", 36.6), ("cups", 37.8)])
def test_published_images(shared: Path, name: str, best: float) -> None:
    """The published method reaches 34.5 and 35.2 dB; the improved one more, from any seed."""
    image, truth, mask = (array[::2, ::2] for array in highlight_photo(shared, name))
    assert psnr(separate(image, mask), truth) >= best


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least"), [("animals", 32.5), ("cups", 35.2)])
def test_sihr_from_a_sample(shared: Path, name: str, least: float) -> None:
    """One random start: between 32.7 and 35.9 dB on animals (the published one 34.5), 35.8 and 37.1
    on cups.
    """
    image, truth, mask = (array[::2, ::2] for array in highlight_photo(shared, name))
    assert psnr(separate(image, mask, replace(VARIANTS["sihr"], sample=1024)), truth) >= least


@pytest.mark.slow
@pytest.mark.parametrize("name", ["box", "frog1"])
def test_near_grey_objects_are_left_alone(shared: Path, name: str) -> None:
    image, _, mask = (array[::2, ::2] for array in laboratory_photo(shared, name))
    quick = replace(VARIANTS["improved"], sample=1000, iterations=200)
    assert not separate(image, mask, quick).specular.any()
    assert separate(image, mask, replace(quick, weigh_evidence=False)).specular.any()


def test_a_rendered_highlight_is_found() -> None:
    image, specular, mask = glossy_scene()
    split = separate(image, mask, QUICK)
    assert np.mean((split.specular[..., 0] - specular)[mask] ** 2) < 0.05 * np.mean(
        specular[mask] ** 2
    )
    assert np.abs(split.diffuse + split.specular - image)[mask].max() < 1e-6
    assert (split.diffuse >= 0).all() and (split.diffuse <= image + 1e-6).all()


def test_descent_reaches_the_minimum() -> None:
    """There the gradient is 0 where the code is positive, and not negative elsewhere."""
    random = np.random.default_rng(1)
    colours = random.uniform(0.1, 1, (3, 5))
    colours /= np.linalg.norm(colours, axis=0)
    own, like = colours.T @ colours, colours.T @ random.uniform(0, 255, (3, 40))
    codes = np.zeros_like(like)
    akashi_2016.descend(like, own, 3.0, codes)
    slope = np.asarray(own @ codes - like + 3.0)
    assert (codes > 0).any(axis=1).all() and (codes == 0).any()
    assert np.abs(slope[codes > 0]).max() < 0.5 and slope[codes == 0].min() > -0.5


@pytest.mark.slow
def test_updates_never_raise_the_objective() -> None:
    image, _, mask = glossy_scene()
    pixels = 255 * image[mask].T
    start = akashi_2016.random_start(pixels, 2, np.random.default_rng(0))

    def objective(iterations: int) -> float:
        options = replace(QUICK, iterations=iterations, tolerance=1e-300)
        codes = start[1].copy()
        return akashi_2016.fit_colours(pixels, start[0], codes, options, Monitor()).objective

    values = [objective(count) for count in range(1, 61)]
    assert all(after <= before * (1 + 1e-9) for before, after in pairwise(values))
    assert values[-1] < 0.5 * values[0]


def test_objective_from_sums_is_that_of_the_pixels() -> None:
    image, _, mask = glossy_scene()
    pixels = 255 * image[mask].T
    start = akashi_2016.random_start(pixels, 2, np.random.default_rng(0))
    fit = akashi_2016.fit_colours(pixels, *start, replace(QUICK, iterations=50), Monitor())
    direct = np.square(pixels - fit.colours @ fit.codes).sum() / 2 + 3 * fit.codes.sum()
    assert fit.objective == pytest.approx(direct, rel=1e-9)


def test_more_starts_keep_the_least_objective() -> None:
    image, _, mask = glossy_scene()
    pixels = np.ascontiguousarray(255 * image[mask].T)
    few, many = (
        akashi_2016.best_fit(
            pixels,
            np.arange(pixels.shape[1]),
            replace(QUICK, start="random", starts=n, iterations=80),
            Monitor(),
        )
        for n in (1, 4)
    )
    assert many.objective < few.objective


def test_scale_surroundings_and_repetition_do_not_matter() -> None:
    image, _, mask = glossy_scene()
    split = separate(image, mask, QUICK)
    assert np.array_equal(split.diffuse, separate(image, mask, QUICK).diffuse)
    padded = np.pad(image, [(9, 9), (9, 9), (0, 0)], constant_values=np.nan)
    wide = separate(64 * padded, np.pad(mask, 9), QUICK)
    assert np.allclose(wide.diffuse[9:-9, 9:-9], 64 * split.diffuse, atol=1e-3)


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_keeps_the_bounds(variant: str) -> None:
    image, _, mask = glossy_scene()
    split = separate(image[::3, ::3], mask[::3, ::3], replace(VARIANTS[variant], iterations=60))
    assert (
        np.isfinite(split.confidence).all()
        and np.isfinite(split.specular).all()
        and split.specular.min() >= 0
    )
    assert (
        (split.diffuse >= 0).all()
        and (split.diffuse <= image[::3, ::3] + 1e-6).all()
        and split.specular.any()
    )


def test_one_pixel_and_clipped_pixels() -> None:
    image, _, mask = glossy_scene()
    single = np.zeros_like(mask)
    single[30, 30] = True
    assert np.isfinite(separate(image, single).diffuse).all()
    clipped = mask & (image.max(axis=2) > 0.8)
    split = separate(np.minimum(image, 0.8), mask, QUICK, clipped=clipped)
    assert not split.confidence[clipped].any() and np.isfinite(split.diffuse).all()
