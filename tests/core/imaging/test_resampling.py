"""Resampling keeps constants and ramps, excludes the background, and scales heights with size."""

import numpy as np
import pytest

from isc_core.imaging.resampling import (
    nearest_samples,
    resample_height,
    resample_inside,
    resampled,
    resampled_shape,
)

FACTORS = [0.2, 0.37, 0.5, 0.99, 1.0, 1.4, 2.0, 3.3]


def places(new: int, old: int) -> np.ndarray:
    """Where the new pixels' centres lie on the old grid."""
    return (np.arange(new) + 0.5) * old / new - 0.5


def test_nothing_changes_at_factor_1() -> None:
    rng = np.random.default_rng(0)
    values, inside = rng.random((13, 17, 3)), rng.random((13, 17)) < 0.7
    out, share = resample_inside(values, inside, 1.0)
    np.testing.assert_array_equal(out, np.where(inside[..., None], values, 0))
    np.testing.assert_array_equal(share, inside)
    height = rng.normal(size=(13, 17))
    same = resample_height(height, (13, 17))
    np.testing.assert_array_equal(same, height)
    assert same is not height


@pytest.mark.parametrize("factor", FACTORS)
def test_a_constant_stays_and_no_background_bleeds_in(factor: float) -> None:
    i, j = np.mgrid[:40, :46]
    inside = np.hypot(i - 20, j - 22) < 15
    out, share = resample_inside(np.where(inside, 0.7, 9.0), inside, factor)
    assert out.shape == share.shape == resampled_shape((40, 46), factor)
    np.testing.assert_allclose(out[share > 1e-6], 0.7, rtol=1e-12)
    assert (out[share == 0] == 0).all()
    assert share.min() >= 0 and share.max() <= 1 + 1e-12
    assert share.sum() == pytest.approx(inside.sum() * share.size / inside.size, rel=0.02)


@pytest.mark.parametrize("factor", FACTORS)
def test_ramps_are_exact(factor: float) -> None:
    """But where new pixels end within old ones: half an old pixel then stands for its middle, and a
    few hundredths are lost.
    """
    i, j = np.mgrid[:40, :46].astype(float)
    out, share = resample_inside(
        np.stack([i, 2 * j - 3 * i], axis=-1), np.ones((40, 46), bool), factor
    )
    rows, columns = np.meshgrid(places(out.shape[0], 40), places(out.shape[1], 46), indexing="ij")
    inner = (rows >= 0) & (rows <= 39) & (columns >= 0) & (columns <= 45)
    np.testing.assert_allclose(share, 1, rtol=1e-12)
    lost = 1e-10 if factor >= 1 or factor == 0.5 else 0.13 * factor
    np.testing.assert_allclose(out[..., 0][inner], rows[inner], atol=lost)
    np.testing.assert_allclose(out[..., 1][inner], (2 * columns - 3 * rows)[inner], atol=5 * lost)


@pytest.mark.parametrize("size", [1, 2, 3])
@pytest.mark.parametrize("factor", [0.1, 0.5, 1.0, 4.0])
def test_tiny_images(size: int, factor: float) -> None:
    out, share = resample_inside(np.full((size, 5), 2.0), np.ones((size, 5), bool), factor)
    np.testing.assert_allclose(out, 2)
    np.testing.assert_allclose(share, 1)
    np.testing.assert_allclose(resample_height(np.zeros((size, 5)), (4, 7)), 0, atol=1e-12)


@pytest.mark.parametrize("factor", [0.3, 0.5, 0.75, 1.5, 2.0, 3.7])
def test_heights_scale_with_the_size(factor: float) -> None:
    """A plane keeps its slope and a sphere its normals: heights are in the new grid's pixels."""
    i, j = np.mgrid[:80, :90].astype(float)
    shape = resampled_shape((80, 90), factor)
    rows, columns = np.meshgrid(places(shape[0], 80), places(shape[1], 90), indexing="ij")
    true_factor = np.sqrt(shape[0] * shape[1] / i.size)
    inner = (rows > 10) & (rows < 69) & (columns > 10) & (columns < 79)
    plane = resample_height(0.5 * i - 0.2 * j, shape)
    np.testing.assert_allclose(
        plane[inner], true_factor * (0.5 * rows - 0.2 * columns)[inner], atol=1e-4
    )
    ball = resample_height(np.sqrt(120.0**2 - (i - 40) ** 2 - (j - 45) ** 2), shape)
    true = np.sqrt(120.0**2 - (rows - 40) ** 2 - (columns - 45) ** 2) * true_factor
    np.testing.assert_allclose(ball[inner], true[inner], atol=1e-4 * factor)


@pytest.mark.parametrize("factor", [1 / 0.2137, 1 / 0.61])
def test_a_grid_whose_last_pixels_reach_beyond_the_photo_does_not_drift(factor: float) -> None:
    """At scale 0.61, 237 rows make 145, the last of them not full: the two shapes alone do not tell
    the scale.
    """
    shape = (237, 301)
    small = tuple(int(np.ceil(n / factor)) for n in shape)
    i, j = np.mgrid[: small[0], : small[1]].astype(float)
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(float)
    inner = (slice(20, -20), slice(20, -20))
    wanted = 0.5 * rows - 0.2 * columns + (0.5 - 0.2) * (0.5 - 0.5 * factor)
    np.testing.assert_allclose(
        resample_height(0.5 * i - 0.2 * j, shape, factor)[inner], wanted[inner], atol=2e-3
    )
    back = nearest_samples(nearest_samples(i, shape, factor), small, 1 / factor)
    np.testing.assert_array_equal(back[:-1], i[:-1])


def test_splines_pass_through_the_heights_up_to_the_border() -> None:
    """Three times as fine, every third node of an odd grid falls on an old one."""
    height = np.random.default_rng(1).normal(size=(9, 11))
    np.testing.assert_allclose(resample_height(height, (27, 33))[1::3, 1::3], 3 * height, atol=1e-3)


def test_there_and_back() -> None:
    i, j = np.mgrid[:60, :64].astype(float)
    height = 10 * np.sin(i / 11) * np.cos(j / 13)
    back = resample_height(resample_height(height, (120, 128)), (60, 64))
    np.testing.assert_allclose(back[4:-4, 4:-4], height[4:-4, 4:-4], atol=0.02)


@pytest.mark.parametrize("shape", [(7, 9), (40, 51), (13, 40)])
@pytest.mark.parametrize("channels", [(), (3,)])
def test_a_whole_image_has_the_values_of_another_program(
    shape: tuple[int, int], channels: tuple[int, ...]
) -> None:
    cv2 = pytest.importorskip("cv2")
    values = np.random.default_rng(0).random((20, 26, *channels), np.float32)
    out = resampled(values, shape)
    assert out.shape == (*shape, *channels) and out.dtype == np.float32
    assert out.mean() == pytest.approx(values.mean(), abs=0.02)
    if shape != (13, 40):  # the other program does not average where only one axis shrinks
        how = cv2.INTER_AREA if shape[0] < 20 else cv2.INTER_LINEAR
        np.testing.assert_allclose(
            out, cv2.resize(values, shape[::-1], interpolation=how), atol=1e-6
        )
