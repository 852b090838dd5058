"""Every filter gives what SciPy's gives: to the last bit, where sums have an order."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import ndimage

from isc_core.filters.box import box_average
from isc_core.filters.components import boxes, labelled, means
from isc_core.filters.correlation import correlated
from isc_core.filters.distance import distance_to, nearest_pixels
from isc_core.filters.extrema import opened, window_maximum, window_minimum
from isc_core.filters.gaussian import gaussian_average, gaussian_taps
from isc_core.filters.interpolation import linear_interpolation, resampled_plane
from isc_core.filters.morphology import dilated, eroded, opened_by_blocks
from isc_core.filters.splines import spline_coefficients, spline_values

SHAPES = [(40, 31), (7, 5), (1, 9), (9, 1)]
SQUARE = np.ones((3, 3))


def image_of(shape: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(1).random(shape)


def masks_of(shape: tuple[int, int]) -> list[np.ndarray]:
    """Sparse, even, dense and full."""
    masks = [image_of(shape) < share for share in (0.05, 0.4, 0.6, 0.9, 1.0)]
    for mask in masks:
        mask[-1, -1] = True
    return masks


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", SHAPES)
def test_gaussian_averages_have_the_bits_of_scipy(shape: tuple[int, int], dtype: type) -> None:
    image: np.ndarray = image_of(shape).astype(dtype)
    for sigma in (0.1, 0.4, 1.0, 2.7, 6.0):
        for cut, mode in ((3.0, "reflect"), (4.0, "constant")):
            ours = gaussian_average(image, sigma, cut=cut, mirrored=mode == "reflect")
            assert ours.dtype == dtype
            assert_array_equal(ours, ndimage.gaussian_filter(image, sigma, truncate=cut, mode=mode))


def test_gaussian_averages_read_any_layout() -> None:
    image = image_of((40, 31))
    assert_array_equal(gaussian_average(image.T, 2.0), gaussian_average(image.T.copy(), 2.0))


def test_gaussian_weights_have_the_sum_one() -> None:
    taps = gaussian_taps(2.3)
    assert taps[0] + 2 * taps[1:].sum() == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [*SHAPES, (40, 31, 3), (9, 8, 2, 2)])
def test_means_over_windows_are_those_of_scipy(shape: tuple[int, ...], dtype: type) -> None:
    image: np.ndarray = np.random.default_rng(3).random(shape).astype(dtype)
    for size in (1, 3, 5, 9, 23, 41):
        for mode in ("reflect", "constant"):
            ours = box_average(image, size, mirrored=mode == "reflect")
            window = (size, size) + (1,) * (len(shape) - 2)
            assert ours.dtype == dtype
            assert_allclose(ours, ndimage.uniform_filter(image, window, mode=mode), rtol=2e-6)


def test_the_mean_of_zeros_beside_other_values_is_zero() -> None:
    image = np.where(np.arange(40) < 20, np.pi * 1e3, 0)[None].repeat(9, axis=0)
    assert_array_equal(box_average(image, 5)[:, 22:], 0)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("taps", [[0.25, 0.5, 0.25], [-2.0, -0.7, 0.0, 0.7, 2.0], [3.0]])
def test_correlations_have_the_bits_of_scipy(taps: list[float], periodic: bool) -> None:
    values, mode = np.random.default_rng(2).random((8, 5, 6, 7)), "wrap" if periodic else "constant"
    for axis in (0, 1, 2, -1):
        expected = ndimage.correlate1d(values, taps, axis=axis, mode=mode)
        assert_array_equal(correlated(values, np.array(taps), axis, periodic), expected)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 8, 11, 60])
def test_windows_have_the_extrema_of_scipy(shape: tuple[int, int], size: int) -> None:
    image = image_of(shape)
    assert_array_equal(window_maximum(image, size), ndimage.maximum_filter(image, size))
    assert_array_equal(window_minimum(image, size), ndimage.minimum_filter(image, size))
    if size % 2:
        assert_array_equal(opened(image, size), ndimage.grey_opening(image, size))


def test_windows_of_colours_do_not_mix_them() -> None:
    image = np.random.default_rng(3).random((9, 8, 3))
    assert_array_equal(window_maximum(image, 3), ndimage.maximum_filter(image, (3, 3, 1)))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("steps", [0, 1, 2, 5])
def test_masks_grow_and_shrink_as_with_scipy(shape: tuple[int, int], steps: int) -> None:
    for mask in masks_of(shape):
        grown, square, shrunk, framed = [mask] * 4
        if steps:
            grown = ndimage.binary_dilation(mask, iterations=steps)
            square = ndimage.binary_dilation(mask, SQUARE, steps)
            shrunk = ndimage.binary_erosion(mask, iterations=steps)
            framed = ndimage.binary_erosion(mask, iterations=steps, border_value=1)
        assert_array_equal(dilated(mask, steps), grown)
        assert_array_equal(dilated(mask, steps, square=True), square)
        assert_array_equal(eroded(mask, steps), shrunk)
        assert_array_equal(eroded(mask, steps, beyond=True), framed)
        assert_array_equal(opened_by_blocks(mask), ndimage.binary_opening(mask, np.ones((2, 2))))


def test_growing_keeps_its_input() -> None:
    mask = masks_of((9, 8))[1]
    before = mask.copy()
    assert dilated(mask) is not mask
    assert eroded(mask) is not mask
    assert_array_equal(mask, before)


@pytest.mark.parametrize("corners", [False, True])
@pytest.mark.parametrize("shape", [*SHAPES, (64, 65)])
def test_components_are_numbered_as_by_scipy(shape: tuple[int, int], corners: bool) -> None:
    for mask in [*masks_of(shape), np.indices(shape).sum(axis=0) % 2 == 0]:
        expected, count = ndimage.label(mask, SQUARE if corners else None)
        labels, found = labelled(mask, corners)
        assert found == count
        assert_array_equal(labels, expected)
        assert boxes(labels, found) == ndimage.find_objects(expected)
        values = image_of(shape)
        numbers = np.arange(1, count + 1)
        assert_array_equal(means(values, labels, found), ndimage.mean(values, expected, numbers))


def test_an_empty_mask_has_no_components() -> None:
    labels, count = labelled(np.zeros((4, 5), bool))
    assert count == 0
    assert not labels.any()
    assert boxes(labels, count) == []
    assert len(means(labels, labels, count)) == 0


@pytest.mark.parametrize("shape", [*SHAPES, (64, 65)])
def test_nearest_pixels_are_those_of_scipy(shape: tuple[int, int]) -> None:
    for mask in masks_of(shape):
        distance, nearest = ndimage.distance_transform_edt(~mask, return_indices=True)
        assert_array_equal(nearest_pixels(mask), nearest)
        assert_array_equal(distance_to(mask), distance)


def test_an_empty_mask_has_no_nearest_pixel() -> None:
    with pytest.raises(ValueError, match="empty"):
        nearest_pixels(np.zeros((3, 4), bool))


@pytest.mark.parametrize("half_step", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_splines_pass_through_the_values(shape: tuple[int, int], half_step: bool) -> None:
    image = image_of(shape)
    found, taps = spline_coefficients(image, half_step), np.array([1, 4, 1]) / 6
    for axis in (0, 1):
        mode = "reflect" if half_step else "mirror"
        found = ndimage.correlate1d(found, taps, axis=axis, mode=mode)
    assert_allclose(found, image, atol=1e-14)


def test_splines_are_those_of_scipy_between_the_values() -> None:
    image, rng = image_of((40, 31)), np.random.default_rng(4)
    rows, columns = 39 * np.append(rng.random(50), [0, 1]), 30 * np.append(rng.random(60), [0, 1])
    coefficients = ndimage.spline_filter(image, 3, mode="nearest")
    assert_allclose(spline_coefficients(image, half_step=True), coefficients, atol=1e-13)
    grid = np.meshgrid(rows, columns, indexing="ij")
    expected = ndimage.map_coordinates(coefficients, grid, order=3, mode="nearest", prefilter=False)
    assert_allclose(spline_values(coefficients, rows, columns), expected, atol=1e-13)


def test_a_plane_is_resampled_along_both_axes() -> None:
    plane = image_of((6, 5))
    down, across = linear_interpolation(np.array([-3, 0.5, 4.25, 9]), 6), np.array([0.0, 3.5])
    expected = np.stack(  # beyond the border, the outermost values continue
        [plane[0], (plane[0] + plane[1]) / 2, 0.75 * plane[4] + 0.25 * plane[5], plane[5]]
    )
    expected = np.stack([expected[:, 0], (expected[:, 3] + expected[:, 4]) / 2], axis=1)
    assert_allclose(resampled_plane(plane, down, linear_interpolation(across, 5)), expected)
