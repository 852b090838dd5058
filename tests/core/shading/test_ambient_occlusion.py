"""Ambient occlusion against shapes whose visible sky is known in closed form."""

import numpy as np
import pytest

from isc_core.shading.ambient_occlusion import ambient_occlusion

SIDE = 161
ROW, COLUMN = np.mgrid[:SIDE, :SIDE].astype(float)
ALL = np.ones((SIDE, SIDE), bool)


@pytest.mark.parametrize("slopes", [(0, 0), (0.5, 0), (0, -2), (1, 3)])
def test_a_plane_is_open_however_it_is_turned(slopes: tuple[float, float]) -> None:
    height = slopes[0] * ROW + slopes[1] * COLUMN
    for mask in (ALL, np.hypot(ROW - 70, COLUMN - 80) < 60):
        assert ambient_occlusion(height, mask).min() > 1 - 2e-3


def test_a_ball_is_open() -> None:
    away = np.hypot(ROW - 80, COLUMN - 80)
    height = np.sqrt(np.maximum(70**2 - away**2, 0))
    share = ambient_occlusion(height, away < 69)
    assert share.min() > 0.98


def groove(angle: float, turned: float) -> tuple[np.ndarray, np.ndarray]:
    """A long V-groove of an opening angle (degrees), turned about the view, and the distance from
    its bottom across it; its walls end at the frame.
    """
    a = np.radians(turned)
    across = np.cos(a) * (COLUMN - 80) + np.sin(a) * (ROW - 80)
    return np.abs(across) / np.tan(np.radians(angle / 2)), across


@pytest.mark.parametrize("angle", [60, 90, 120])
@pytest.mark.parametrize("turned", [0, 45, 90])
def test_a_groove_has_the_sky_between_its_walls(angle: float, turned: float) -> None:
    """At the bottom, facing up: sin(angle / 2), the configuration factor of a strip."""
    height, across = groove(angle, turned)
    bottom = ambient_occlusion(height, ALL, reach=0.45)[np.abs(across) < 0.1]
    middle = bottom[len(bottom) // 2]
    assert middle == pytest.approx(np.sin(np.radians(angle / 2)), rel=0.03)


@pytest.mark.parametrize("angle", [60, 90, 120])
def test_on_a_wall_the_other_one_hides_the_sky(angle: float) -> None:
    """From its normal, a point of the wall sees from -90 degrees, up along the wall, to the edge of
    the other one: (1 + sin(end)) / 2.
    """
    half, across = np.radians(angle / 2), np.arange(-20.0, 21)
    height = np.abs(across) / np.tan(half)
    long = np.broadcast_to(height, (801, 41))
    share = ambient_occlusion(long, np.ones(long.shape, bool), reach=0.5)[400]
    for column in range(22, 40):
        edge = np.arctan2(height[0] - height[column], across[0] - across[column])
        normal = np.pi - half  # of the wall on the right, which rises by pi / 2 - half
        expected = (1 + np.sin(edge - normal)) / 2
        assert share[column] == pytest.approx(expected, abs=0.05)


def test_a_pit_is_darker_than_its_rim_and_the_reach_counts() -> None:
    away = np.hypot(ROW - 80, COLUMN - 80)
    height = np.where(away < 20, 0.0, 30.0)
    share = ambient_occlusion(height, ALL)
    depth = np.arctan(20 / 30)  # a disc of sky of this half angle: sin^2
    assert share[80, 80] == pytest.approx(np.sin(depth) ** 2, rel=0.12)
    assert share[80, 120] > 0.999
    assert ambient_occlusion(height, ALL, reach=0.05)[80, 80] > 0.99


def test_what_is_outside_the_mask_hides_nothing_and_stays_bright() -> None:
    mask = COLUMN < 80
    share = ambient_occlusion(np.where(mask, 0.0, 500.0), mask)
    assert (share == 1).all()
    assert share.dtype == np.float32
    thin = np.zeros_like(ALL)
    thin[3, 4] = True
    assert (ambient_occlusion(ROW, thin) == 1).all()
