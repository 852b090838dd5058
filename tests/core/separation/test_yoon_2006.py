"""Yoon, Choi & Kweon 2006: published figures, the exact end of its sweeps, and what it must leave
alone.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.separation.published import yoon_2006
from isc_core.separation.published.yoon_2006 import VARIANTS, Yoon2006Options
from isc_core.separation.support.colour_groups import group_quantile
from tests.core.separation.scenes import (
    assert_any_mask_and_noise_keep_the_layers_sound,
    assert_clipped_cores_are_filled_and_inform_nobody,
    assert_layers_hold,
    assert_scale_and_surroundings_do_not_matter,
    error_ratio,
    glossy_disc,
    highlight_photo,
    laboratory_photo,
    psnr,
)


@pytest.mark.parametrize(
    ("name", "published", "improved"), [("animals", 32.896, 37.5), ("cups", 33.296, 37.9)]
)
def test_figures(shared: Path, name: str, published: float, improved: float) -> None:
    image, truth, mask = highlight_photo(shared, name)
    assert psnr(yoon_2006.separate(image, mask, VARIANTS["sihr"]), truth) == pytest.approx(
        published, abs=0.01
    )
    assert psnr(yoon_2006.separate(image, mask), truth) > improved


def test_mask_statistics_on_apple(shared: Path) -> None:
    image, truth, mask = laboratory_photo(shared, "apple")
    split = yoon_2006.separate(image, mask)
    assert_layers_hold(split, image, mask)
    assert error_ratio(split, image, truth, mask) < 0.18


@pytest.mark.parametrize("name", ["box", "phone", "squirrel", "teabag2"])
def test_pale_objects_are_left_alone(shared: Path, name: str) -> None:
    image, truth, mask = laboratory_photo(shared, name)
    assert error_ratio(yoon_2006.separate(image, mask), image, truth, mask) <= 1 + 1e-3
    assert error_ratio(yoon_2006.separate(image, mask, VARIANTS["sihr"]), image, truth, mask) > 15


@pytest.mark.parametrize(
    ("variant", "most"), [("improved", 0.001), ("paper", 0.001), ("sihr", 0.02)]
)
def test_highlights_on_three_paints(variant: str, most: float) -> None:
    image, diffuse, mask = glossy_disc()
    split = yoon_2006.separate(image, mask, VARIANTS[variant])
    assert_layers_hold(split, image, mask)
    assert error_ratio(split, image, diffuse, mask) < most


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_matte_paint_is_left_alone(variant: str) -> None:
    _, diffuse, mask = glossy_disc()
    split = yoon_2006.separate(diffuse, mask, VARIANTS[variant])
    assert np.sqrt(np.mean(split.specular[mask] ** 2)) < 0.005 * np.sqrt(
        np.mean(diffuse[mask] ** 2)
    )


def noisy_disc() -> tuple[np.ndarray, np.ndarray]:
    image, _, mask = glossy_disc()
    random = np.random.default_rng(5)
    return np.clip(image + random.normal(0, 0.02, image.shape), 0, None), mask & (
        random.random(mask.shape) > 0.3
    )


def test_sweeps_end_at_the_smallest_ratio_of_each_region() -> None:
    image, mask = noisy_disc()
    same = {"quantile": 0.0, "cells": 1, "window": 1, "weigh_evidence": False, "tolerance": 0.0}
    swept = yoon_2006.separate(image, mask, Yoon2006Options(regions=False, **same))
    solved = yoon_2006.separate(image, mask, Yoon2006Options(regions=True, **same))
    assert solved.specular.max() > 0.4
    assert np.array_equal(swept.specular, solved.specular)


def test_regions_are_those_of_a_flood_fill() -> None:
    image, mask = noisy_disc()
    options = Yoon2006Options(colour_step=10.0, window=1, dark=0.0)
    pixels = yoon_2006._two_band(np.where(mask[..., None], image, 0), mask, mask, options)
    parent = np.arange(mask.size)
    for axis in (1, 0):
        yoon_2006._unite(*yoon_2006._pairs(pixels, options.colour_step, axis), parent)
    yoon_2006._flatten(parent)
    labels, count = ndimage.label(pixels.known)
    assert count > 50
    both = np.unique(
        np.stack([parent.reshape(mask.shape)[pixels.known], labels[pixels.known]]), axis=1
    )
    assert both.shape[1] == count and len(np.unique(both[0])) == count


def test_quantiles_of_groups() -> None:
    random = np.random.default_rng(1)
    group, values = random.integers(0, 7, 300) * 10**6, random.random(300)
    found = group_quantile(group, values, 0.35)
    for name in np.unique(group):
        assert (
            found[group == name] == np.quantile(values[group == name], 0.35, method="lower")
        ).all()


@pytest.mark.parametrize(
    ("variant", "scale"), [("improved", 1000.0), ("improved", 1e-5), ("paper", 1.0)]
)
def test_scale_and_surroundings_do_not_matter(variant: str, scale: float) -> None:
    assert_scale_and_surroundings_do_not_matter(
        yoon_2006.separate, VARIANTS[variant], scale, least=0.4
    )


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_any_mask_and_noise_keep_the_layers_sound(variant: str) -> None:
    assert_any_mask_and_noise_keep_the_layers_sound(yoon_2006.separate, VARIANTS[variant])


def test_clipped_cores_are_filled_from_around_and_inform_nobody() -> None:
    assert_clipped_cores_are_filled_and_inform_nobody(yoon_2006.separate, at_most=0.05)


def test_refuses_what_it_cannot_use() -> None:
    image, _, mask = glossy_disc()
    with pytest.raises(InputError, match="no colour"):
        yoon_2006.separate(np.repeat(image[..., :1], 3, axis=2), mask)
    with pytest.raises(InputError, match="mask is empty"):
        yoon_2006.separate(image, np.zeros_like(mask))
    for name, value in {
        "colour_step": 0,
        "dark": -1,
        "quantile": 2,
        "cells": 0,
        "window": 2,
        "sweeps": -1,
        "tolerance": -1,
    }.items():
        with pytest.raises(InputError, match=name):
            yoon_2006.separate(image, mask, Yoon2006Options(**{name: value}))
    for variant in VARIANTS.values():
        with pytest.raises(Cancelled):
            yoon_2006.separate(image, mask, variant, monitor=Monitor(cancelled=lambda: True))
