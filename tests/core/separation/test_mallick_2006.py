"""Mallick et al. 2006: how far erosion reaches, what an opening restores, large photos."""

import numpy as np
import pytest

from isc_core.separation.published import mallick_2006
from isc_core.separation.published.mallick_2006 import VARIANTS, Mallick2006Options
from tests.core.separation.scenes import assert_layers_hold
from tests.core.separation.scenes import conical_plate as plate


@pytest.mark.slow
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
