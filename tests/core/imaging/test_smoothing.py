"""Averages inside a mask: what they keep, and what they do not see."""

import numpy as np
import pytest
from scipy import ndimage

from isc_core.imaging.smoothing import masked_gaussian, weighted_gaussian


def disc(height: int = 40, width: int = 50) -> np.ndarray:
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    return x**2 + y**2 < 0.8


def texture(*shape: int) -> np.ndarray:
    return np.random.default_rng(1).random(shape)


@pytest.mark.parametrize("sigma", [0.7, 3.0])
def test_constants_are_kept_up_to_the_outline(sigma: float) -> None:
    mask = disc()
    image = np.where(mask[..., None], [0.2, 0.5, 3.0], 100.0)
    assert np.allclose(masked_gaussian(image, mask, sigma)[mask], [0.2, 0.5, 3.0], rtol=1e-6)
    assert np.allclose(masked_gaussian(image[..., 1], mask, sigma)[mask], 0.5, rtol=1e-6)


def test_what_is_outside_is_not_seen() -> None:
    mask, layer = disc(), texture(40, 50)
    other = np.where(mask, layer, 1e6)
    assert np.allclose(masked_gaussian(layer, mask, 2.0), masked_gaussian(other, mask, 2.0))


def test_it_is_the_normalised_convolution() -> None:
    mask, layer = disc(), texture(40, 50)
    dense = np.zeros(mask.shape)
    dense[20, 11] = 1
    kernel = ndimage.gaussian_filter(dense, 1.5, truncate=3)
    assert mask[20, 11] and not mask[20, 0]
    expected = (kernel * layer)[mask].sum() / kernel[mask].sum()
    assert masked_gaussian(layer, mask, 1.5)[20, 11] == pytest.approx(expected, rel=1e-6)


def test_channels_are_averaged_by_themselves() -> None:
    mask, image = disc(), texture(40, 50, 3)
    whole = masked_gaussian(image, mask, 1.2)
    for c in range(3):
        assert np.array_equal(whole[..., c], masked_gaussian(image[..., c], mask, 1.2))


def test_the_result_is_0_far_outside_the_mask() -> None:
    mask = np.zeros((40, 50), bool)
    mask[:5, :5] = True
    assert not masked_gaussian(np.ones((40, 50)), mask, 1.0)[30:, 30:].any()


def test_zero_width_is_the_identity() -> None:
    layer = texture(40, 50)
    assert np.array_equal(masked_gaussian(layer, disc(), 0.0), layer)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_precision_is_that_of_the_layer(kind: type) -> None:
    assert masked_gaussian(texture(40, 50).astype(kind), disc(), 1.0).dtype == kind


def test_little_weight_is_drawn_to_zero_by_the_floor() -> None:
    ones = np.ones((20, 30))
    for weight, expected in ((1.0, 1 / 1.1), (0.1, 0.5), (0.0, 0.0)):
        assert np.allclose(weighted_gaussian(ones, weight * ones, 2.0, 0.1), expected)


def test_weights_count_as_shares() -> None:
    layer, weight = texture(20, 30), 0.1 + texture(20, 30)
    found = weighted_gaussian(layer, weight, 2.0, 1e-12)
    assert np.allclose(weighted_gaussian(layer, 7 * weight, 2.0, 7e-12), found)
    assert np.allclose(weighted_gaussian(3 * layer + 2, weight, 2.0, 1e-12), 3 * found + 2)
    assert found.min() >= layer.min() and found.max() <= layer.max()
