"""Parts of a map: what is put back is what was cut out."""

import numpy as np
import pytest

from isc_core.imaging.window import Window, as_map

MASK = np.random.default_rng(0).random((7, 9)) < 0.4


@pytest.mark.parametrize("channels", [(), (3,)])
def test_the_pixels_of_a_mask_return_to_their_places(channels: tuple[int, ...]) -> None:
    values = np.random.default_rng(1).random((*MASK.shape, *channels)).astype(np.float32)
    found = as_map(values[MASK], MASK, outside=2.0)
    assert found.dtype == np.float32 and found.shape == values.shape
    assert (found[MASK] == values[MASK]).all() and (found[~MASK] == 2).all()


def test_a_map_has_the_type_of_its_values_or_the_given_one() -> None:
    values = np.random.default_rng(2).random(np.count_nonzero(MASK))
    assert (as_map(values, MASK)[MASK] == values).all()
    assert (as_map(values, MASK, dtype=np.float32)[MASK] == values.astype(np.float32)).all()


def test_a_window_beyond_the_image_is_pasted_back() -> None:
    image = np.random.default_rng(3).random((5, 6))
    window = Window(-2, 3, 6, 7)
    cut = window.cut(image, fill=-1)
    assert cut.shape == (6, 7) and np.count_nonzero(cut == -1) == 6 * 7 - 4 * 3
    back = window.put(cut, image.shape)
    assert (back[:4, 3:] == image[:4, 3:]).all() and back.sum() == image[:4, 3:].sum()
