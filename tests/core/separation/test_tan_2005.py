"""Tan & Ikeuchi 2005: published figures, what the sweeps leave invariant, and what they must leave
alone.
"""

from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.separation.published import tan_2005
from isc_core.separation.published.tan_2005 import VARIANTS, Tan2005Options
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
    ("name", "published", "improved"), [("animals", 30.43, 37.6), ("cups", 31.59, 37.2)]
)
def test_figures(shared: Path, name: str, published: float, improved: float) -> None:
    image, truth, mask = highlight_photo(shared, name)
    # Rounding decides many ties of 8-bit values, and each tie spreads: hence the wide band.
    assert psnr(tan_2005.separate(image, mask, VARIANTS["sihr"]), truth) == pytest.approx(
        published, abs=0.2
    )
    assert psnr(tan_2005.separate(image, mask), truth) > improved


def test_limits_keep_the_apple_from_darkening(shared: Path) -> None:
    image, truth, mask = laboratory_photo(shared, "apple")
    split = tan_2005.separate(image, mask)
    assert_layers_hold(split, image, mask)
    assert error_ratio(split, image, truth, mask) < 0.25
    assert error_ratio(tan_2005.separate(image, mask, VARIANTS["sihr"]), image, truth, mask) > 5


@pytest.mark.parametrize("name", ["box", "phone", "squirrel", "teabag2"])
def test_pale_objects_are_left_alone(shared: Path, name: str) -> None:
    image, truth, mask = laboratory_photo(shared, name)
    assert error_ratio(tan_2005.separate(image, mask), image, truth, mask) <= 1 + 1e-3


@pytest.mark.parametrize(
    ("variant", "most"), [("improved", 0.001), ("paper", 0.15), ("sihr", 0.15)]
)
def test_highlights_on_three_paints(variant: str, most: float) -> None:
    image, diffuse, mask = glossy_disc()
    split = tan_2005.separate(image, mask, VARIANTS[variant])
    assert_layers_hold(split, image, mask)
    assert error_ratio(split, image, diffuse, mask) < most


def test_matte_paint_is_left_alone() -> None:
    _, diffuse, mask = glossy_disc()
    assert not tan_2005.separate(diffuse, mask).specular.any()
    # As published, green and blue paint are not told apart, since their shares of red are alike:
    # one paint then.
    plain = np.array([0.7, 0.2, 0.1]) * diffuse.sum(axis=2, keepdims=True)
    for variant in VARIANTS.values():
        assert tan_2005.separate(plain, mask, variant).specular.max() < 1e-6


def test_no_pixel_passes_the_limit_of_its_colour() -> None:
    image, _, mask = glossy_disc()
    image = image * np.random.default_rng(2).uniform(0.8, 1.25, image.shape)
    options = Tan2005Options(
        dark=0, window=1, cells=1, quantile=0.7, weigh_evidence=False, colour_step=1
    )
    before, after = (
        colours.max(axis=1) / colours.sum(axis=1)
        for colours in (image[mask], tan_2005.separate(image, mask, options).diffuse[mask])
    )
    limit = np.quantile(before, 0.7, method="lower")
    moved = after > before + 1e-5
    assert moved.mean() > 0.5
    assert after[moved].max() <= limit + 1e-5


def test_one_noisy_pixel_does_not_colour_the_surface() -> None:
    y, x = np.mgrid[-1:1:60j, -1:1:60j]
    image = np.array([0.5, 0.3, 0.2]) * (1 - 0.3 * (x**2 + y**2))[..., None]
    image[30, 30] = [0.5, 0.25, 0.12]
    mask = np.ones(x.shape, bool)
    spread, kept = (
        tan_2005.separate(image, mask, options)
        for options in (VARIANTS["paper"], Tan2005Options(weigh_evidence=False))
    )
    assert (spread.specular[..., 0] > 0.02).mean() > 0.9
    assert not (kept.specular > 0.001).any()


@pytest.mark.parametrize(
    ("variant", "scale"), [("improved", 1024.0), ("improved", 2.0**-17), ("paper", 1.0)]
)
def test_scale_and_surroundings_do_not_matter(variant: str, scale: float) -> None:
    assert_scale_and_surroundings_do_not_matter(
        tan_2005.separate, VARIANTS[variant], scale, least=0.3
    )


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_any_mask_and_noise_keep_the_layers_sound(variant: str) -> None:
    assert_any_mask_and_noise_keep_the_layers_sound(tan_2005.separate, VARIANTS[variant])


def test_clipped_cores_are_filled_from_around_and_inform_nobody() -> None:
    assert_clipped_cores_are_filled_and_inform_nobody(tan_2005.separate, at_most=0.1)


def test_refuses_what_it_cannot_use() -> None:
    image, _, mask = glossy_disc()
    with pytest.raises(InputError, match="no colour"):
        tan_2005.separate(np.repeat(image[..., :1], 3, axis=2), mask)
    with pytest.raises(InputError, match="mask is empty"):
        tan_2005.separate(image, np.zeros_like(mask))
    wrongs = {
        "start": -1,
        "step": 0,
        "noise": 0,
        "colour_step": 0,
        "dark": -1,
        "quantile": 2,
        "cells": 0,
        "window": 2,
    }
    for name, value in wrongs.items():
        with pytest.raises(InputError, match=name):
            tan_2005.separate(image, mask, Tan2005Options(**{name: value}))
    with pytest.raises(Cancelled):
        tan_2005.separate(image, mask, monitor=Monitor(cancelled=lambda: True))
