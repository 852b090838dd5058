"""Images that white light does not reach, compared with what their equations promise."""

import numpy as np

from isc_core.separation.support.specular_free import (
    dark_channel,
    fixed_chromaticity,
    less_dark_channel,
    lifted_two_band,
    modified,
    two_band,
)
from tests.core.separation.scenes import glossy_disc


def test_white_light_does_not_reach_the_exact_ones() -> None:
    image, diffuse, mask = glossy_disc()
    assert np.abs(image - diffuse).max() > 0.4
    for free in (fixed_chromaticity, two_band):
        assert np.allclose(free(image)[mask], free(diffuse)[mask], atol=1e-12)
    lifted = lifted_two_band(image, mask)[mask] - lifted_two_band(diffuse, mask)[mask]
    assert lifted.min() > 0
    assert np.ptp(lifted) < 1e-12


def test_the_largest_chromaticity_is_the_one_asked_for() -> None:
    image, _, mask = glossy_disc()
    free = fixed_chromaticity(image, 0.5)[mask]
    assert np.allclose(free.max(axis=1) / free.sum(axis=1), 0.5)


def test_the_modified_image_leaves_what_is_dark_and_cuts_what_is_bright() -> None:
    image, _, mask = glossy_disc()
    low = image.min(axis=2)[mask]
    level = low.mean() + 0.5 * low.std()
    changed = modified(image, mask)[mask]
    assert np.array_equal(changed[low <= level], image[mask][low <= level])
    assert changed.min(axis=1).max() <= level + 1e-12


def test_the_dark_channel_is_the_least_value_near_by_inside_the_mask() -> None:
    low = np.arange(42.0).reshape(6, 7)
    mask = np.ones(low.shape, bool)
    mask[0] = False
    dark = dark_channel(low, mask, 3)
    assert dark[3, 3] == low[2, 2]
    assert dark[1, 3] == low[1, 2], "the row outside the mask does not count"
    image, diffuse, disc = glossy_disc()
    left = np.abs(less_dark_channel(image, disc, 3) - less_dark_channel(diffuse, disc, 3))[
        disc
    ].mean()
    assert left < 0.5 * np.abs(image - diffuse)[disc].mean(), "most of the highlight is gone"
    assert not less_dark_channel(image, disc)[~disc].any()
