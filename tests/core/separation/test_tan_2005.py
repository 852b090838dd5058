"""Tan & Ikeuchi 2005: what its sweeps move, and what they leave alone."""

import numpy as np
import pytest

from isc_core.separation.published import tan_2005
from isc_core.separation.published.tan_2005 import VARIANTS, Tan2005Options
from tests.core.separation.scenes import glossy_disc


def test_diffuse_surface_is_left_alone() -> None:
    _, diffuse, mask = glossy_disc()
    assert not tan_2005.separate(diffuse, mask).specular.any()
    # As published, green and blue are not separated, since their shares of red are alike: use one
    # albedo.
    plain = np.array([0.7, 0.2, 0.1]) * diffuse.sum(axis=2, keepdims=True)
    for variant in VARIANTS.values():
        assert tan_2005.separate(plain, mask, variant).specular.max() < 1e-6


@pytest.mark.slow
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
