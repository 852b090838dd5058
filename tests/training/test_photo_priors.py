"""What the priors of photos are fitted to: white balance, lights of panoramas, jumps of height."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from isc_core.shading.spherical_harmonics import reference_basis

pytest.importorskip("torch")

from training.priors.panorama_photos import (
    camera_picture,
    colour_on_a_ball,
    draw_turn,
    photograph,
)
from training.priors.photographed_bodies import height_steps
from training.priors.white_balance import ALGORITHMS, GREY_WORLD
from training.world.environments import Panorama

LIGHT = np.array([1.3, 1.0, 0.7])


@pytest.mark.parametrize("name", ALGORITHMS)
def test_white_balance_finds_the_light_on_grey_things(name: str) -> None:
    grey = np.random.default_rng(0).uniform(0.05, 0.6, (40, 50, 1))
    found = ALGORITHMS[name].light(grey * LIGHT)
    np.testing.assert_allclose(found, LIGHT / np.prod(LIGHT) ** (1 / 3), rtol=1e-6)


def test_clipped_pixels_do_not_count_and_a_clipped_photo_tells_nothing() -> None:
    photo = np.full((30, 30, 3), 0.4) * LIGHT
    photo[:15] = (1, 1, 1)
    np.testing.assert_allclose(GREY_WORLD.light(photo), LIGHT / np.prod(LIGHT) ** (1 / 3))
    np.testing.assert_array_equal(GREY_WORLD.light(np.ones((30, 30, 3))), np.ones(3))


def test_a_uniform_panorama_of_one_colour_lights_a_ball_evenly_in_it() -> None:
    radiance = np.ones((16, 32, 3)) * LIGHT
    rng = np.random.default_rng(1)
    turn = draw_turn(rng)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    wanted = LIGHT / np.prod(LIGHT) ** (1 / 3)
    np.testing.assert_allclose(colour_on_a_ball(radiance, turn), wanted, rtol=1e-6)
    picture, gain = camera_picture(radiance, turn, rng)
    np.testing.assert_allclose(picture, np.minimum(gain * LIGHT, 1) * np.ones_like(picture))


def test_a_rolled_panorama_is_one_seen_after_a_turn_about_the_vertical() -> None:
    """At every column, the seam behind the middle included; a pole is no seam."""
    radiance = 1e-3 * np.random.default_rng(3).uniform(size=(16, 32, 3))
    first, _ = camera_picture(radiance, np.eye(3), np.random.default_rng(4))
    for columns in (5, 16):
        turn = Rotation.from_euler("y", -360 * columns / 32, degrees=True).as_matrix()
        rolled = np.roll(radiance, columns, axis=1)
        again, _ = camera_picture(rolled, turn, np.random.default_rng(4))
        np.testing.assert_allclose(again, first, rtol=1e-9)


def test_a_photo_s_light_is_the_panorama_s_in_the_reference_s_convention() -> None:
    """Light from above only: brightest for normals that look up, which is -down."""
    radiance = np.full((32, 64, 3), 0.05)
    radiance[:8] = 2.0
    seen = photograph(Panorama("sky", radiance, False), radiance, np.random.default_rng(2))
    up, down = reference_basis(np.array([[0.0, 0.9, 0.436], [0.0, -0.9, 0.436]])) @ seen.light
    assert (up > down + 0.5).all()
    assert seen.light[3].max() < 0  # the coefficient of N1, which points down
    np.testing.assert_allclose(seen.unbalanced, np.ones(3), rtol=1e-6)
    np.testing.assert_allclose(seen.cast, np.ones(3), rtol=1e-6)


def test_height_jumps_where_the_normals_do_not_say_so() -> None:
    rows, columns = np.mgrid[:20, :20]
    slope = 0.8
    normal = np.broadcast_to(np.array([-slope, 0, 1]) / np.hypot(slope, 1), (20, 20, 3))
    plane = slope * columns + 0.0 * rows
    assert not height_steps(plane, normal).any()
    stepped = plane + 5.0 * (columns >= 10)
    found = height_steps(stepped, normal)
    assert found[:, 9:11].all() and not found[:, :9].any() and not found[:, 11:].any()
    holed = np.where(rows == 3, np.nan, plane)
    assert not height_steps(holed, normal).any()
