"""Blocks of pixels, and weights as they are stored."""

import numpy as np
import pytest

from isc_core.networks.layers import depth_to_space, space_to_depth, weights_in


def test_blocks_of_pixels_go_there_and_back() -> None:
    layer = np.arange(4 * 6 * 3.0).reshape(4, 6, 3)
    blocks = space_to_depth(layer, 2)
    np.testing.assert_array_equal(blocks[1, 2].reshape(3, 2, 2), layer[2:4, 4:6].transpose(2, 0, 1))
    np.testing.assert_array_equal(depth_to_space(blocks, 2), layer)


def test_weights_of_16_bits_are_converted_exactly() -> None:
    every = np.arange(1 << 16, dtype=np.uint16).view(np.float16)
    finite = every[np.isfinite(every)].reshape(1, -1)
    (found,), _ = weights_in({"weight00": finite, "bias00": finite[0, :3]})
    np.testing.assert_array_equal(found.view(np.int32), finite.astype(np.float32).view(np.int32))


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, -np.nan])
def test_weights_are_finite(kind: type, value: float) -> None:
    values: np.ndarray = np.array([1, value, -2], kind)
    with pytest.raises(ValueError, match="not finite"):
        weights_in({"weight00": np.ones(2, kind), "bias00": values})
