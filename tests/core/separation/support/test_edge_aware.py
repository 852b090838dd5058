"""Averages along paths: what they keep, how far they reach, what they do not cross."""

import numpy as np
import pytest

from isc_core.numerics.jit import compiled_available
from isc_core.separation.support import edge_aware
from isc_core.separation.support.edge_aware import Paths


def open_paths(height: int, width: int, reach: float) -> Paths:
    return Paths(np.ones((height, width)), np.ones((height, width)), reach)


def rough_paths(height: int = 40, width: int = 50, reach: float = 8.0) -> Paths:
    """Distances at random, some beyond reach."""
    rng = np.random.default_rng(1)
    across, down = (1 + 100 * rng.random((height, width)) ** 8 for _ in range(2))
    return Paths(across, down, reach)


def texture(*shape: int, seed: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).random(shape)


def test_constants_are_kept_whatever_the_paths() -> None:
    for paths in (open_paths(40, 50, 8.0), rough_paths()):
        assert np.allclose(paths.average(np.full((2, 40, 50), 0.3)), 0.3)
        assert np.allclose(paths.weighted(np.full((40, 50), 0.3), texture(40, 50)), 0.3)
        assert np.allclose(paths.lower_mode(np.full((40, 50), 0.3), texture(40, 50), 0.1, 3), 0.3)


def test_it_is_an_average() -> None:
    layers = texture(3, 40, 50)
    before = layers.copy()
    found = rough_paths().average(layers)
    assert (
        found.min() >= layers.min()
        and found.max() <= layers.max()
        and found.std() < 0.5 * layers.std()
    )
    assert np.array_equal(layers, before)
    assert np.allclose(rough_paths().average(5 * layers - 2), 5 * found - 2)
    assert np.allclose(rough_paths().average(layers[1:2])[0], found[1])


@pytest.mark.parametrize("axis", [0, 1])
def test_nothing_crosses_an_infinite_edge(axis: int) -> None:
    paths = rough_paths()
    (paths.down if axis == 0 else paths.across)[(slice(None), 20) if axis == 1 else 20] = 1e9
    one, other = texture(40, 50), texture(40, 50, seed=3)
    mixed = np.where(np.indices((40, 50))[axis] < 20, one, other)
    found, alone = (paths.average(layer[None])[0] for layer in (mixed, one))
    before = np.s_[:20] if axis == 0 else np.s_[:, :20]
    assert np.array_equal(found[before], alone[before])
    after = np.s_[20:] if axis == 0 else np.s_[:, 20:]
    assert np.abs(found[after] - alone[after]).max() > 0.05


def test_an_edge_matters_beside_it_only() -> None:
    edged = open_paths(60, 160, 5.0)
    edged.across[:, 20] = 1e9
    layer = texture(1, 60, 160)
    difference = np.abs(edged.average(layer) - open_paths(60, 160, 5.0).average(layer))[0]
    assert difference[:, 15:25].max() > 0.02 and difference[:, 80:].max() < 1e-5


def test_reach_is_the_standard_deviation() -> None:
    """Of what one pixel becomes: symmetric, of sum 1, and as wide as asked along both axes."""
    spot = np.zeros((1, 201, 201))
    spot[0, 100, 100] = 1
    for reach in (6.0, 12.0):
        found = open_paths(201, 201, reach).average(spot)[0]
        offset = np.arange(201) - 100
        assert found.sum() == pytest.approx(1, abs=1e-3)
        assert np.allclose(found, found[::-1, ::-1], atol=1e-6) and np.allclose(
            found, found.T, atol=1e-6
        )
        for axis in (0, 1):
            assert np.sqrt((found.sum(axis=axis) * offset**2).sum()) == pytest.approx(
                reach, rel=0.03
            )


def test_far_from_borders_a_slope_stays() -> None:
    rows, columns = np.indices((120, 140))
    plane = 0.2 + 0.01 * rows - 0.02 * columns
    found = open_paths(120, 140, 4.0).average(plane[None])[0]
    assert np.abs(found - plane)[45:-45, 45:-45].max() < 1e-4


def test_pixels_without_weight_say_nothing() -> None:
    value, weight = texture(40, 50), texture(40, 50, seed=4)
    weight[10:20, 10:30] = 0
    wild = np.where(weight == 0, 1e6, value)
    assert np.allclose(rough_paths().weighted(value, weight), rough_paths().weighted(wild, weight))
    assert not rough_paths().weighted(value, 0 * weight).any()


def spotted() -> tuple[np.ndarray, np.ndarray]:
    """An albedo of .3 with some scatter, and where a third of it is raised."""
    rng = np.random.default_rng(6)
    y, x = np.mgrid[:80, :100]
    raised = ((x % 25) < 15) & ((y % 20) < 11)
    value = 0.3 + 0.01 * rng.standard_normal((80, 100)) + 0.4 * raised
    return value, raised


def test_the_lower_mode_is_hardly_moved_by_what_lies_above() -> None:
    value, raised = spotted()
    assert 0.3 < raised.mean() < 0.36
    paths, ones = open_paths(80, 100, 15.0), np.ones((80, 100))
    mean, mode = paths.weighted(value, ones), paths.lower_mode(value, ones, 0.1, 6)
    assert np.abs(mean - 0.3).mean() > 0.1 and np.abs(mode - 0.3)[20:-20, 20:-20].max() < 0.03
    below = paths.lower_mode(0.6 - value, ones, 0.1, 6)
    assert np.abs(below - 0.3)[20:-20, 20:-20].min() > 0.05, (
        "what lies below is no highlight and counts in full"
    )


def test_the_lower_mode_falls_with_every_round_until_it_stands() -> None:
    value, _ = spotted()
    paths, ones = open_paths(80, 100, 15.0), np.ones((80, 100))
    modes = [paths.lower_mode(value, ones, 0.1, rounds) for rounds in (0, 1, 2, 4, 20, 21)]
    assert np.array_equal(modes[0], paths.weighted(value, ones))
    means = [mode.mean() for mode in modes]
    assert means == sorted(means, reverse=True) and np.abs(modes[5] - modes[4]).max() < 1e-3


def test_the_lower_mode_goes_with_its_unit() -> None:
    value, _ = spotted()
    paths, ones = open_paths(80, 100, 15.0), np.ones((80, 100))
    mode = paths.lower_mode(value, ones, 0.1, 4)
    assert np.allclose(paths.lower_mode(7 * value + 2, ones, 0.7, 4), 7 * mode + 2)


def test_rows_and_columns_count_alike() -> None:
    """Exactly where nothing is in the way; within a hundredth of the values' range where borders
    are.
    """
    value, _ = spotted()
    ones = np.ones((80, 100))
    plain, turned = open_paths(80, 100, 12.0), open_paths(100, 80, 12.0)
    assert np.allclose(plain.average(value[None])[0], turned.average(value.T[None])[0].T)
    y, x = np.mgrid[:80, :100]
    part = (x - 50) ** 2 + (y - 40) ** 2 < 25**2
    across, down = np.ones((80, 100)), np.ones((80, 100))
    across[:, 1:][part[:, 1:] != part[:, :-1]] = 1e6
    down[1:][part[1:] != part[:-1]] = 1e6
    value = np.where(part, value + 0.2, value)
    one = Paths(across, down, 12.0).lower_mode(value, ones, 0.1, 4)
    other = (
        Paths(down.T.copy(), across.T.copy(), 12.0)
        .lower_mode(np.ascontiguousarray(value.T), ones.T.copy(), 0.1, 4)
        .T
    )
    assert np.abs(one - other).max() < 0.05 and np.abs(one - other).mean() < 0.005


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 3)])
def test_small_photos(shape: tuple[int, int]) -> None:
    value = texture(*shape)
    found = open_paths(*shape, reach=1.0).lower_mode(value, np.ones(shape), 0.1, 3)
    assert (
        found.shape == shape
        and found.min() >= value.min() - 1e-12
        and found.max() <= value.max() + 1e-12
    )


@pytest.mark.skipif(not compiled_available(), reason="needs compiled kernels")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_kernel_has_the_bytes_of_numpy(dtype: type, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = rough_paths()
    layers: np.ndarray = texture(2, 40, 50).astype(dtype)
    paths = Paths(paths.across.astype(dtype), paths.down.astype(dtype), paths.reach)
    compiled = paths.average(layers)
    monkeypatch.setattr(edge_aware, "compiled_available", lambda: False)
    assert np.array_equal(compiled, paths.average(layers))
