"""Which rims are soft: hair, fur and mist are, outlines are not, however they were drawn."""

import numpy as np
import pytest
from scipy import ndimage

from isc_core.masking.refinement import feathered
from isc_core.photo.soft_rim import soft_rim

SIZE, RADIUS = 160, 50


def distance(shift: float = 0.0) -> np.ndarray:
    row, column = np.indices((SIZE, SIZE)) - SIZE / 2 + shift
    return np.hypot(row, column) - RADIUS


def wedge(share: float) -> np.ndarray:
    """The pixels of a part of the circle."""
    row, column = np.indices((SIZE, SIZE)) - SIZE / 2
    return np.abs(np.arctan2(row, column)) < share * np.pi


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("own", [True, False])
def test_an_outline_is_not_soft(shift: float, own: bool) -> None:
    cover = np.clip(0.5 - distance(shift), 0, 1)
    assert soft_rim(cover, cover >= 0.5, own) is None
    blurred = ndimage.gaussian_filter(cover, 0.8)
    assert soft_rim(blurred, blurred >= 0.5, own) is None


@pytest.mark.parametrize("contrast", [8, 40, 160])
def test_a_mask_that_was_found_is_an_outline(contrast: int) -> None:
    """The guided filter spreads the outline over several pixels where colours are alike."""
    rng, mask = np.random.default_rng(0), distance() < 0
    plain = 100 + contrast * ndimage.gaussian_filter(mask * 1.0, 2) + rng.normal(0, 4, mask.shape)
    codes = np.clip(plain, 0, 255).astype(np.uint8)[..., None].repeat(3, 2)
    cover = feathered(codes, mask)
    assert ((cover > 0.1) & (cover < 0.9)).any()
    assert soft_rim(cover, cover >= 0.5, own=False) is None


def test_a_wide_ramp_is_soft_where_it_is() -> None:
    soft = wedge(0.25)
    cover = np.where(soft, np.clip(0.5 - distance() / 20, 0, 1), np.clip(0.5 - distance(), 0, 1))
    found = soft_rim(cover, cover >= 0.5, own=False)
    assert found is not None
    partly = (cover > 0.1) & (cover < 0.9)
    assert found[partly & soft].mean() > 0.95
    assert not found[~ndimage.binary_dilation(soft, np.ones((3, 3)), 8)].any()


def test_strands_are_soft() -> None:
    away = distance()
    row, column = np.indices(away.shape) - SIZE / 2
    around = np.arctan2(row, column)
    strands = np.where((away > 0) & (away < 18), 0.5 + 0.5 * np.sin(60 * around), 0)
    cover = np.maximum(np.clip(0.5 - away, 0, 1), strands * np.clip(1 - away / 18, 0, 1))
    assert soft_rim(cover, cover >= 0.5, own=True) is not None


def test_a_tuft_alone_is_none() -> None:
    cover = np.where(wedge(0.02), np.clip(0.5 - distance() / 20, 0, 1), distance() < 0)
    assert soft_rim(cover, cover >= 0.5, own=True) is None


@pytest.mark.parametrize("opacity", [0.3, 0.45, 0.6])
@pytest.mark.parametrize("blur", [6, 12])
def test_a_shadow_in_the_alpha_channel_is_no_hair(opacity: float, blur: float) -> None:
    solid = np.clip(0.5 - distance(), 0, 1)
    shadow = np.roll(ndimage.gaussian_filter(solid, blur), (8, 6), (0, 1)) * opacity
    cover = solid + (1 - solid) * shadow
    assert soft_rim(cover, cover >= 0.5, own=True) is None


def test_hair_beside_a_shadow_is_found_alone() -> None:
    hair = wedge(0.25)
    solid = np.where(hair, np.clip(0.5 - distance() / 20, 0, 1), np.clip(0.5 - distance(), 0, 1))
    shadow = 0.3 * np.roll(ndimage.gaussian_filter(solid, 3), (0, -16), (0, 1)) * ~hair
    cover = solid + (1 - solid) * np.where(wedge(0.6), 0, shadow)
    found = soft_rim(cover, solid >= 0.5, own=True)
    assert found is not None
    assert found[hair & (np.abs(distance()) < 6)].mean() > 0.9
    assert not found[~wedge(0.5)].any()
