"""Area averages are exact integrals, of the object and of the background separately."""

import numpy as np
import pytest

from isc_core.filters import interpolation
from isc_core.filters.interpolation import banded_products, linear_interpolation
from isc_core.imaging.area_resize import AreaFilter, averaged, resize_separately
from isc_core.imaging.bounding_box import FramePart
from isc_core.numerics.ellpack import Ellpack

SHAPE = (41, 57)


def overlaps(count: int, factor: float) -> np.ndarray:
    """Length of the overlap of each new pixel, 1 long, with each of `count` old ones."""
    new = np.arange(int(np.ceil(count * factor - 1e-6)))[:, None]
    old = np.arange(count) * factor
    return np.clip(np.minimum(new + 1, old + factor) - np.maximum(new, old), 0, None)


@pytest.mark.parametrize("factor", [0.13, 0.5, 0.81])
def test_object_and_background_are_averaged_separately(factor: float) -> None:
    rng = np.random.default_rng(1)
    image = rng.random((*SHAPE, 3), np.float32)
    mask = rng.random(SHAPE) < 0.4
    area = AreaFilter.of(SHAPE, factor)
    new_mask = rng.random(area.full.shape) < 0.5
    found = resize_separately(image, mask, new_mask, area)
    down, across = (overlaps(count, factor) for count in SHAPE)
    for inside in (False, True):
        share = down @ (mask == inside) @ across.T
        for channel in range(3):
            total = down @ (image[..., channel] * (mask == inside)) @ across.T
            expected = np.divide(total, share, out=np.zeros_like(total), where=share > 0)
            chosen = new_mask == inside
            np.testing.assert_allclose(
                found[..., channel][chosen], expected[chosen], rtol=2e-5, atol=1e-7
            )


def test_a_view_of_a_photo_is_averaged_like_its_copy() -> None:
    rng = np.random.default_rng(2)
    image, mask = rng.random((*SHAPE, 3), np.float32), rng.random(SHAPE) < 0.7
    box = np.s_[5:33, 9:50]
    views = averaged(image[box], mask[box], 0.6)
    copies = averaged(image[box].copy(), mask[box].copy(), 0.6)
    assert all(np.array_equal(one, other) for one, other in zip(views, copies, strict=True))


@pytest.mark.parametrize("factor", [0.13, 0.37, 0.81])
def test_a_part_of_the_means_is_that_of_all(factor: float) -> None:
    values = np.random.default_rng(3).integers(0, 256, SHAPE).astype(np.uint8)
    area = AreaFilter.of(SHAPE, factor)
    whole = area(values) / area.full
    rows, columns = whole.shape
    part = FramePart(slice(rows // 3, rows + 2), slice(1, columns - 1), (rows + 2, columns))
    np.testing.assert_allclose(
        area.means(values, part), whole[rows // 3 :, 1 : columns - 1], rtol=1e-6
    )


@pytest.mark.parametrize("size", [7, 40, 90])
def test_blocks_of_a_product_are_those_of_the_whole(
    size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interpolation, "_VALUES", 64)
    values = np.random.default_rng(4).integers(0, 9, (40, 6, 3)).swapaxes(1, 2)
    matrix = linear_interpolation(np.linspace(-1, 40, size), 40)
    blocks = list(banded_products(matrix, values))
    assert len(blocks) > 1
    assert [rows.start for rows, _ in blocks[1:]] == [rows.stop for rows, _ in blocks[:-1]]
    assert np.array_equal(np.concatenate([block for _, block in blocks]), matrix @ values)


def test_rows_without_entries_give_zeros() -> None:
    matrix = Ellpack.of(np.array([2]), np.array([5]), np.array([3.0]), (4, 9))
    part, columns = matrix.band(slice(0, 2))
    values = np.arange(9.0)[:, None]
    assert not (part @ values[columns]).any()
    assert (matrix.band(slice(1, 4))[0] @ values[5:6]).ravel().tolist() == [0, 15, 0]
