"""Detection of gamuts without white."""

from itertools import permutations

import numpy as np
import pytest

from isc_core.illuminant.gamut import PLANE, distance_of_white, lacks_white, share_toward_white
from isc_core.illuminant.illuminant import estimate_illuminant
from tests.core.illuminant.test_illuminant import ALBEDOS, ball

GREY = np.full((1, 3), 0.4)
SOFT = (ALBEDOS + 0.3) / 2
STRONG = [np.array(light) for light in permutations((1.8, 1.0, 0.2))]


def lines(start: np.ndarray, end: np.ndarray, number: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Colours (N, 3) on the way from one to another, and their changes."""
    parts = np.linspace(0.1, 0.5, number)[:, None]
    return start + parts * end, np.full((number, 3), 0.1) * end


@pytest.mark.parametrize("light", STRONG)
@pytest.mark.parametrize("albedos", [SOFT, SOFT[:1], SOFT[1:3], GREY])
def test_strongly_coloured_light_is_detected(albedos: np.ndarray, light: np.ndarray) -> None:
    found = estimate_illuminant(*ball(albedos, light, 0.5))
    assert found.outcome.too_strong and not found.determined


@pytest.mark.parametrize("light", [0.5 + 0.5 * np.sqrt(light) for light in STRONG])
def test_moderately_coloured_light_is_detected_on_grey(light: np.ndarray) -> None:
    assert estimate_illuminant(*ball(GREY, light, 0.5)).outcome.too_strong


@pytest.mark.parametrize("light", [np.ones(3), np.array([1.1, 1.0, 0.9])])
@pytest.mark.parametrize("albedos", [ALBEDOS, *(albedo[None] for albedo in ALBEDOS), GREY])
def test_a_lamp_s_light_is_not_where_highlights_show_it(
    albedos: np.ndarray, light: np.ndarray
) -> None:
    assert not estimate_illuminant(*ball(albedos, light, 0.5)).outcome.too_strong


def test_many_paints_without_highlights_hold_white_and_one_does_not() -> None:
    white = np.ones(3)
    assert not estimate_illuminant(*ball(ALBEDOS, white, 0.0)).outcome.too_strong
    assert not estimate_illuminant(*ball(GREY, white, 0.0)).outcome.too_strong
    assert estimate_illuminant(
        *ball(ALBEDOS[:1], white, 0.0)
    ).outcome.too_strong  # as grey albedo under red light


def test_the_distance_is_that_of_the_hull() -> None:
    albedo = np.array([[0.6, 0.3, 0.3]])
    place = 3 * albedo[0] / albedo.sum() @ PLANE
    assert distance_of_white(np.repeat(albedo, 100, axis=0)) == pytest.approx(
        np.linalg.norm(place), rel=2e-3
    )  # of 64 directions
    around = np.repeat(np.eye(3) + 0.1, 100, axis=0)
    assert distance_of_white(around) < 0
    assert distance_of_white(around * [1.0, 1.0, 5.0]) == pytest.approx(
        distance_of_white(around[:, ::-1] * [5.0, 1.0, 1.0]), rel=1e-9
    )
    assert distance_of_white(np.zeros((100, 3))) == 0


def test_flanks_toward_white_are_known_from_others() -> None:
    red, white, blue = np.array([0.6, 0.1, 0.1]), np.ones(3), np.array([0.3, 0.9, 1.8])
    assert share_toward_white(*lines(red, white)) > 0.95
    assert share_toward_white(*lines(red, blue)) < 0.2
    assert share_toward_white(*lines(white, white)) == 0  # no colour changes


def test_few_colours_are_uninformative_and_thinning_has_no_influence() -> None:
    red = np.repeat([[0.6, 0.1, 0.1]], 200, axis=0)
    assert lacks_white(red, np.zeros_like(red))
    assert not lacks_white(red[:5], np.zeros((5, 3)))
    colour, change = lines(np.array([0.6, 0.1, 0.1]), np.ones(3), 50_000)
    few = slice(None, None, 100)
    assert share_toward_white(colour, change) == pytest.approx(
        share_toward_white(colour[few], change[few]), abs=0.02
    )
