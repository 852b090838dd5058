"""The base colour at the photo's resolution: exact where shading and gloss are smooth."""

import numpy as np
import pytest

from isc_core.imaging.srgb import srgb_to_linear
from isc_core.result_files.photo_texture import photo_base_color


@pytest.mark.parametrize("size", [(48, 64), (46, 63)])
def test_the_texture_keeps_the_photos_detail(size: tuple[int, int]) -> None:
    """A checker of the photo's pixels under light that falls from left to right."""
    rng = np.random.default_rng(0)
    row, column = np.indices(size)
    paint = np.where((row + column)[..., None] % 2, 0.2, 0.6) * rng.uniform(0.8, 1, 3)
    photo = paint * (1 - 0.5 * column / size[1])[..., None]
    small = tuple(int(np.ceil(n / 4)) for n in size)
    frame = np.pad(
        photo, [(0, 4 * m - n) for n, m in zip(size, small, strict=True)] + [(0, 0)], "edge"
    )
    image = frame.reshape(small[0], 4, small[1], 4, 3).mean((1, 3))
    wide = np.pad(
        paint, [(0, 4 * m - n) for n, m in zip(size, small, strict=True)] + [(0, 0)], "edge"
    )
    base = wide.reshape(small[0], 4, small[1], 4, 3).mean((1, 3))
    codes = photo_base_color(image, image, base, photo, 0.25)
    assert codes.shape == (4 * small[0], 4 * small[1], 3) and codes.dtype == np.uint8
    inner = codes[8 : size[0] - 8, 8 : size[1] - 8] / 255
    np.testing.assert_allclose(
        srgb_to_linear(inner), paint[8 : size[0] - 8, 8 : size[1] - 8], atol=0.02
    )


def test_below_a_highlight_the_texture_is_that_of_the_maps() -> None:
    photo = np.ones((32, 32, 3))
    diffuse, base = np.full((8, 8, 3), 0.01), np.full((8, 8, 3), 0.3)
    codes = photo_base_color(np.ones((8, 8, 3)), diffuse, base, photo, 0.25)
    np.testing.assert_allclose(srgb_to_linear(codes / 255.0), 0.3, atol=0.01)
