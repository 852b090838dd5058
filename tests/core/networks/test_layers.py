"""Blocks of pixels, and weights that are not finite."""

import numpy as np
import pytest

from isc_core.networks.layers import depth_to_space, space_to_depth, weights_in


def test_blocks_of_pixels_go_there_and_back() -> None:
    layers = np.arange(2 * 4 * 6 * 3.0).reshape(2, 4, 6, 3)
    blocks = space_to_depth(layers, 2)
    one = layers[1, 2:4, 4:6].transpose(2, 0, 1)
    np.testing.assert_array_equal(blocks[1, 1, 2].reshape(3, 2, 2), one)
    np.testing.assert_array_equal(depth_to_space(blocks, 2), layers)


def test_every_finite_weight_of_16_bits_is_accepted() -> None:
    every = np.arange(1 << 16, dtype=np.uint16).view(np.float16)
    finite = every[np.isfinite(every)].reshape(1, -1)
    (found,), _ = weights_in({"weight00": finite, "bias00": finite[0, :3]})
    assert found is finite


@pytest.mark.parametrize(
    "value", np.arange(1 << 16, dtype=np.uint16).view(np.float16)[[0x7C00, 0x7FFF, 0xFC00, 0xFFFF]]
)
def test_no_other_one_is(value: np.float16) -> None:
    with pytest.raises(ValueError, match="not finite"):
        weights_in({"weight00": np.array([-6, value, 3], np.float16), "bias00": np.ones(3)})


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, -np.nan])
def test_weights_are_finite(kind: type, value: float) -> None:
    values: np.ndarray = np.array([1, value, -2], kind)
    with pytest.raises(ValueError, match="not finite"):
        weights_in({"weight00": np.ones(2, kind), "bias00": values})
