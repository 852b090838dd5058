"""The grid over place and hue: hues, votes, reading and quantiles against known answers."""

import colorsys

import numpy as np
import pytest

from isc_core.separation.support.hue_grid import HueGrid, Places, hue_of, quantile


def hues_of(image: np.ndarray) -> np.ndarray:
    return hue_of(image, image.min(axis=2), image.max(axis=2))


def pixels(count: int = 400, seed: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and hues (n,) inside a photo of 60 x 80 pixels."""
    rng = np.random.default_rng(seed)
    return 59 * rng.random(count), 79 * rng.random(count), 6 * rng.random(count)


GRID = HueGrid((60, 80), 9.0, 12)


# --- hue ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_hues_are_those_of_the_colour_circle(kind: type) -> None:
    image: np.ndarray = np.random.default_rng(0).random((20, 30, 3)).astype(kind)
    found = hues_of(image)
    expected = np.array(
        [[6 * colorsys.rgb_to_hsv(*map(float, pixel))[0] for pixel in row] for row in image]
    )
    assert found.dtype == kind and np.abs(found - expected).max() < 1e-5 * (
        6 if kind is np.float32 else 1e-6
    )
    assert found.min() >= 0 and found.max() < 6


def test_pure_colours_have_whole_hues() -> None:
    image = np.array(
        [
            [
                [1, 0, 0],
                [1, 1, 0],
                [0, 1, 0],
                [0, 1, 1],
                [0, 0, 1],
                [1, 0, 1],
                [0.4, 0.4, 0.4],
                [0, 0, 0],
            ]
        ],
        float,
    )
    assert hues_of(image)[0].tolist() == [0, 1, 2, 3, 4, 5, 0, 0]


def test_white_light_and_exposure_leave_the_hue_alone() -> None:
    image = np.random.default_rng(0).random((20, 30, 3))
    light = 2 * np.random.default_rng(1).random((20, 30, 1))
    for gain in (1e-3, 1.0, 1e3):
        assert np.allclose(hues_of(gain * (image + light)), hues_of(image), atol=1e-9)


def test_just_below_red_stays_on_the_circle() -> None:
    found = hues_of(np.array([[[1.0, 0.2, 0.2 + 1e-8]]], np.float32))
    assert 0 <= found[0, 0] < 6


# --- the grid -------------------------------------------------------------------------------------


def test_every_pixel_lies_among_the_cells() -> None:
    corner_rows, corner_columns = np.array([0.0, 0, 59, 59]), np.array([0.0, 79, 0, 79])
    for cell in (1.0, 7.3, 80.0, 500.0):
        grid = HueGrid((60, 80), cell, 6)
        places = grid.places(corner_rows, corner_columns, np.array([0.0, 5.9999, 3, 1.5]))
        for index, share in places.corners:
            assert index.min() >= 0 and index.max() < np.prod(grid.shape)
            assert share.min() >= 0 and share.max() <= 1


def test_shares_of_the_eight_cells_add_up() -> None:
    shares = [share for _, share in GRID.places(*pixels()).corners]
    assert len(shares) == 8 and np.allclose(np.sum(shares, axis=0), 1, atol=1e-6)


def test_a_linear_table_is_read_exactly() -> None:
    rows, columns, hue = pixels()
    down, across, around = np.indices(GRID.shape)
    last_cell = hue * GRID.hues / 6 >= GRID.hues - 1
    found = GRID.places(rows, columns, hue).read(0.5 + 2 * down - 3 * across + 0.7 * around)
    expected = 0.5 + 2 * rows / GRID.cell - 3 * columns / GRID.cell + 0.7 * hue * GRID.hues / 6
    assert last_cell.any() and np.abs(found - expected)[~last_cell].max() < 1e-4


def test_hues_are_round() -> None:
    """Between the last hue and the first the table is linear too."""
    table = np.broadcast_to(np.cos(2 * np.pi * np.arange(GRID.hues) / GRID.hues), GRID.shape)
    hue = 6 * (GRID.hues - 1 + np.array([0.0, 0.25, 0.999])) / GRID.hues
    beyond = np.array([0.0, 0.25, 0.999])
    found = GRID.places(np.full(3, 20.0), np.full(3, 20.0), hue).read(table)
    assert found == pytest.approx(
        (1 - beyond) * table[0, 0, -1] + beyond * table[0, 0, 0], abs=1e-5
    )


def test_votes_are_conserved() -> None:
    rng = np.random.default_rng(3)
    rows, columns = (
        20 + 15 * rng.random(300),
        20 + 30 * rng.random(300),
    )  # nothing is blurred over the rim
    bins, weight = rng.integers(0, 7, 300), rng.random(300).astype(np.float32)
    near, everywhere = GRID.histograms(
        GRID.places(rows, columns, 6 * rng.random(300)), bins, 7, weight
    )
    of_bins = np.bincount(bins, weight, 7)
    assert near.shape == (*GRID.shape, 7) and everywhere.shape == (GRID.hues, 7) and near.min() >= 0
    # Blurring over places doubles the votes in each direction, so that a pixel amid its like finds
    # as many as a cell has.
    assert np.allclose(near.sum(axis=(0, 1, 2)), 4 * of_bins, rtol=1e-5)
    assert np.allclose(
        everywhere.sum(axis=0), of_bins + 20 * GRID.hues * of_bins / of_bins.sum(), rtol=1e-5
    )


def test_a_vote_reaches_its_neighbours_alone() -> None:
    grid = HueGrid((60, 80), 10.0, 12)
    near, _ = grid.histograms(
        grid.places(np.array([30.0]), np.array([40.0]), np.array([0.0])),
        np.array([2]),
        4,
        np.ones(1, np.float32),
    )
    blurred = np.zeros((*grid.shape, 4))
    for i, down in zip((2, 3, 4), (0.5, 1.0, 0.5), strict=True):
        for j, across in zip((3, 4, 5), (0.5, 1.0, 0.5), strict=True):
            for k, around in zip((-1, 0, 1), (0.25, 0.5, 0.25), strict=True):
                blurred[i, j, k, 2] = down * across * around
    assert np.allclose(near, blurred)


def test_no_votes_at_all() -> None:
    near, everywhere = GRID.histograms(
        GRID.places(*pixels(5)), np.zeros(5, int), 4, np.zeros(5, np.float32)
    )
    assert (
        not near.any()
        and np.allclose(everywhere, everywhere[0, 0])
        and np.isfinite(quantile(everywhere, 0.5)).all()
    )


def test_turning_all_hues_by_a_cell_turns_the_votes() -> None:
    rows, columns, hue = pixels()
    bins, weight = np.arange(400) % 5, np.ones(400, np.float32)
    near, everywhere = GRID.histograms(GRID.places(rows, columns, hue), bins, 5, weight)
    turned, turned_everywhere = GRID.histograms(
        GRID.places(rows, columns, (hue + 6 / GRID.hues) % 6), bins, 5, weight
    )
    assert np.allclose(np.roll(near, 1, axis=2), turned, atol=1e-4)
    assert np.allclose(np.roll(everywhere, 1, axis=0), turned_everywhere, atol=1e-4)


def test_pixels_of_other_hues_have_no_say() -> None:
    """Two albedos in the same place: the median that each reads is its own."""
    rng = np.random.default_rng(5)
    hue = np.repeat([1.0, 4.0], 500)
    places: Places = GRID.places(60 * rng.random(1000), 80 * rng.random(1000), hue)
    near, _ = GRID.histograms(places, np.where(hue == 1, 20, 70), 100, np.ones(1000, np.float32))
    found = places.read(quantile(near, 0.5))
    assert (
        np.abs(found[hue == 1] - 0.205).max() < 0.006
        and np.abs(found[hue == 4] - 0.705).max() < 0.006
    )


# --- quantiles ------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.05, 0.25, 0.5, 0.99])
def test_quantiles_of_known_histograms(share: float) -> None:
    assert quantile(np.ones(50), share) == pytest.approx(share)
    one_bin = np.eye(10)[3] * 7.5
    assert quantile(one_bin, share) == pytest.approx((3 + share) / 10)
    spikes = np.zeros(10)
    spikes[[1, 8]] = 3, 1
    expected = (1 + share / 0.75) / 10 if share < 0.75 else (8 + (share - 0.75) / 0.25) / 10
    assert quantile(spikes, share) == pytest.approx(expected)


def test_quantiles_are_those_of_the_values() -> None:
    values = np.random.default_rng(7).beta(2, 5, (3, 4, 5000))
    histograms = np.apply_along_axis(lambda v: np.histogram(v, 100, (0, 1))[0], 2, values)
    for share in (0.1, 0.25, 0.9):
        assert np.abs(quantile(histograms, share) - np.quantile(values, share, axis=2)).max() < 0.01


def test_weight_of_all_votes_does_not_matter_and_shares_rise() -> None:
    histograms = np.random.default_rng(8).random((6, 30))
    found = [quantile(histograms, share) for share in np.linspace(0.01, 0.99, 40)]
    assert (np.diff(found, axis=0) >= 0).all() and np.min(found) >= 0 and np.max(found) <= 1
    assert np.allclose(quantile(1000 * histograms, 0.3), quantile(histograms, 0.3))
