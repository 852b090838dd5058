"""Linear shape from shading: its derivatives, its minimum, and what it must not invent."""

import numpy as np
import pytest

from isc_core.decomposition.layers import normals_and_shading
from isc_core.shading import relief_from_shading as module
from isc_core.shading.relief_from_shading import (
    REACH,
    RHO,
    log_shading,
    relief_from_shading,
    shading_gain,
    slopes,
    slopes_adjoint,
)

RNG = np.random.default_rng(5)
LIGHT = RNG.normal(0, 0.2, 9)
FROM_THE_RIGHT = np.array([0, 1.0, 0, 0, 0, 0, 0, 0, 0])  # of the reference's functions, n_2


def flat(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(shape, np.float32), np.zeros(shape, np.float32)


def test_slopes_and_their_adjoint() -> None:
    height, right, down = RNG.normal(size=(3, 9, 12))
    right[:, [0, -1]], down[[0, -1]] = 0, 0
    p, q = slopes(height)
    assert (p * right + q * down).sum() == pytest.approx(
        (height * slopes_adjoint(right, down)).sum()
    )


def test_log_shading_is_that_of_the_maps() -> None:
    y, x = np.mgrid[:16, :16].astype(float)
    height = 0.3 * x - 0.2 * y
    _, shading = normals_and_shading(
        height, np.tile(LIGHT[:, None], 3), np.ones((16, 16), bool), np.float64
    )
    found = log_shading(slopes(height), LIGHT)
    assert found[8, 8] == pytest.approx(float(np.log(shading[8, 8, 0])), abs=1e-6)


def test_gain_is_the_derivative_of_log_shading() -> None:
    right, down = RNG.normal(size=(2, 5, 5))
    gain, step = shading_gain((right, down), LIGHT), 1e-5
    for axis in range(2):
        ahead, behind = (
            log_shading((right + s * (axis == 0), down + s * (axis == 1)), LIGHT)
            for s in (step, -step)
        )
        np.testing.assert_allclose(gain[axis], (ahead - behind) / (2 * step), atol=1e-7)


def test_many_iterations_reach_the_minimum(monkeypatch: pytest.MonkeyPatch) -> None:
    """The normal equations of the linear problem on a flat surface, solved densely."""
    monkeypatch.setattr(module, "ITERATIONS", 4000)
    monkeypatch.setattr(module, "_LEAST_EIGENVALUE", 1e-5)
    monkeypatch.setattr(module, "_RIDGE", 0.0)
    side = 12
    change = 0.01 * RNG.normal(size=(side, side)).astype(np.float32)
    inside = np.ones((side, side), bool)
    start = np.zeros((side, side), np.float32)
    found = relief_from_shading(
        change[None], inside, flat(inside.shape), FROM_THE_RIGHT[:, None], start
    )
    unit = np.eye(side * side).reshape(-1, side, side)
    p, q = (np.array([slopes(one)[k].ravel() for one in unit]).T for k in range(2))
    gain = shading_gain(flat((1, 1)), FROM_THE_RIGHT)[0].item()
    rows = np.vstack([gain * p, RHO * p, RHO * q])
    wanted = np.concatenate([change.ravel(), np.zeros(2 * side * side)])
    best = np.linalg.lstsq(rows, wanted, rcond=None)[0].reshape(side, side)
    for one, other in zip(slopes(found), slopes(best), strict=True):
        np.testing.assert_allclose(one, other, atol=2e-4)


@pytest.mark.parametrize("period", [4, 6, 10])
def test_ripples_toward_the_light_are_found_and_those_across_are_not(period: int) -> None:
    y, x = np.mgrid[:96, :96].astype(np.float32)
    inside = np.ones((96, 96), bool)
    for along, least, most in ((x, 0.85, 1.0), (y, -0.01, 0.01)):
        ripples = 0.1 * np.sin(2 * np.pi * along / period).astype(np.float32)
        change = log_shading(slopes(ripples), FROM_THE_RIGHT).astype(np.float32)
        found = relief_from_shading(
            change[None],
            inside,
            flat(inside.shape),
            FROM_THE_RIGHT[:, None],
            np.zeros_like(ripples),
        )
        inner = (slice(24, -24), slice(24, -24))
        true, got = (np.stack(slopes(one))[(slice(None), *inner)] for one in (ripples, found))
        assert least <= float((true * got).sum() / (true * true).sum()) <= most


def test_a_light_of_another_colour_from_below_shows_ripples_across_the_first() -> None:
    y = np.mgrid[:96, :96][0].astype(np.float32)
    inside, ripples = np.ones((96, 96), bool), 0.1 * np.sin(np.pi * y / 3).astype(np.float32)
    from_below = np.eye(9)[3]  # of the reference's functions, n_1
    light = np.stack([FROM_THE_RIGHT, from_below], axis=1)
    change = np.stack([log_shading(slopes(ripples), one) for one in light.T]).astype(np.float32)
    found = [
        relief_from_shading(change[:k], inside, flat((96, 96)), light[:, :k], 0 * ripples)
        for k in (1, 2)
    ]
    true, none, got = (slopes(one)[1][24:-24, 24:-24] for one in (ripples, *found))
    explained = [float((true * one).sum() / (true * true).sum()) for one in (none, got)]
    assert abs(explained[0]) < 0.01 and 0.85 < explained[1] <= 1


def test_light_that_tells_nothing_gives_no_relief() -> None:
    inside, change = np.ones((40, 40), bool), RNG.normal(size=(40, 40)).astype(np.float32)
    found = relief_from_shading(
        change[None], inside, flat(inside.shape), np.eye(9)[:, :1], np.zeros_like(change)
    )
    assert np.abs(found).max() < 1e-6


def test_values_depend_on_near_pixels_alone() -> None:
    start, *change = 0.1 * RNG.normal(size=(4, 90, 110)).astype(np.float32)
    features, light = np.stack(change), RNG.normal(0, 0.2, (9, 3))
    slope = tuple(RNG.normal(size=(2, 90, 110)).astype(np.float32))
    inside = RNG.random((90, 110)) > 0.1
    whole = relief_from_shading(features, inside, (slope[0], slope[1]), light, start)
    part = (slice(20, 80), slice(30, 100))
    cut = relief_from_shading(
        features[:, *part], inside[part], (slope[0][part], slope[1][part]), light, start[part]
    )
    inner = (slice(REACH, -REACH), slice(REACH, -REACH))
    assert np.array_equal(whole[part][inner], cut[inner])
