"""Lights: their irradiance follows radiometry, and is kept when they become an environment."""

from collections.abc import Callable

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.shading.environment_map import directions, shading_under, solid_angles
from synth.scene.lights import (
    DirectionalLight,
    EnvironmentLight,
    Light,
    PanelLight,
    PointLight,
    lights_as_environment,
    panel_toward_origin,
    scaled,
)

WARM = np.array([3.0, 2.0, 1.0])
SLANTED = np.array([0.48, 0.6, 0.64])


def irradiance(environment: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return np.pi * shading_under(environment, normal[None])[0]


@pytest.mark.parametrize(
    ("light", "across"),
    [
        (DirectionalLight(SLANTED, WARM), WARM),
        (PointLight(4 * SLANTED, WARM), WARM / 16),
        (panel_toward_origin(5 * SLANTED, (0.01, 0.02), WARM), WARM * 0.0002 / 25),
    ],
    ids=["directional", "point", "small panel"],
)
@pytest.mark.parametrize("rows", [32, 50])
def test_small_lights_keep_their_irradiance_in_an_environment(
    light: Light, across: np.ndarray, rows: int
) -> None:
    """A plane perpendicular to the beam gets all of it, and one at 60 degrees half of it, to the
    size of a pixel.
    """
    picture = lights_as_environment((light,), rows)
    half = np.cross(SLANTED, (1.0, 0, 0))
    half = np.cos(np.pi / 3) * SLANTED + np.sin(np.pi / 3) * half / np.linalg.norm(half)
    np.testing.assert_allclose(irradiance(picture, SLANTED), across, rtol=5e-3)
    np.testing.assert_allclose(irradiance(picture, half), across / 2, rtol=0.1)


def test_a_panel_seen_head_on_has_the_irradiance_of_a_rectangle() -> None:
    """The closed form on the axis of a square:

    E = 4 L a / w atan(a / w), w = sqrt(1 + a^2), a = half its side / its distance.
    """
    distance, half = 3.0, 1.2
    panel = panel_toward_origin((0, 0, distance), (2 * half, 2 * half), WARM)
    a = half / distance
    root = np.sqrt(1 + a * a)
    wanted = WARM * 4 * (a / root) * np.arctan(a / root)
    np.testing.assert_allclose(
        irradiance(lights_as_environment((panel,), 256), np.array([0, 0, 1.0])), wanted, rtol=0.01
    )


def test_a_panel_faces_the_origin_with_the_requested_size_and_stays_upright() -> None:
    panel = panel_toward_origin((2, 3, 4), (0.5, 1.5), WARM)
    np.testing.assert_allclose(panel.normal, -np.array([2, 3, 4]) / np.sqrt(29), atol=1e-12)
    np.testing.assert_allclose(
        [panel.area, 2 * np.linalg.norm(panel.right), 2 * np.linalg.norm(panel.up)],
        [0.75, 0.5, 1.5],
    )
    assert panel.right[1] == pytest.approx(0)
    assert panel.up[1] > 0
    assert panel_toward_origin((0, 5, 0), (1, 1), WARM).area == pytest.approx(1)


def test_a_panel_that_faces_away_gives_no_light() -> None:
    panel = panel_toward_origin((0, 0, 3), (1, 1), WARM)
    turned = PanelLight(panel.centre, panel.up, panel.right, panel.radiance)
    assert lights_as_environment((turned,), 32).max() == 0


def test_an_environment_keeps_its_light_at_any_resolution() -> None:
    sky = np.random.default_rng(0).gamma(0.5, size=(24, 48, 3))
    for rows in (12, 20, 64):
        picture = lights_as_environment((EnvironmentLight(sky),), rows)
        total = (picture * solid_angles(rows)[..., None]).sum((0, 1))
        np.testing.assert_allclose(
            total, (sky * solid_angles(24)[..., None]).sum((0, 1)), rtol=1e-5
        )


def test_lights_add_up_and_scale() -> None:
    lights: tuple[Light, ...] = (
        DirectionalLight(SLANTED, WARM),
        PointLight(np.array([0, 3.0, 1]), WARM),
        panel_toward_origin((-3, 0, 2), (2, 2), WARM),
        EnvironmentLight(np.ones((8, 16, 3))),
    )
    apart = sum(lights_as_environment((light,), 16) for light in lights)
    np.testing.assert_allclose(lights_as_environment(lights, 16), apart, rtol=1e-6)
    brighter = lights_as_environment(tuple(scaled(light, 2.5) for light in lights), 16)
    np.testing.assert_allclose(brighter, 2.5 * np.asarray(apart), rtol=1e-6)


def test_a_light_is_where_it_stands() -> None:
    picture = lights_as_environment((PointLight(3 * SLANTED, WARM),), 64)
    brightest = directions(64)[np.unravel_index(picture.sum(-1).argmax(), picture.shape[:2])]
    assert brightest @ SLANTED > np.cos(np.pi / 64)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: DirectionalLight(np.array([0, 0, 2.0]), WARM), "length 1"),
        (lambda: DirectionalLight(SLANTED, -WARM), "negative"),
        (lambda: PointLight(np.array([0, np.nan, 1]), WARM), "position"),
        (lambda: PointLight(SLANTED, np.ones(4)), "intensity"),
        (
            lambda: PanelLight(SLANTED, np.array([1.0, 0, 0]), np.array([1.0, 1, 0]), WARM),
            "right angles",
        ),
        (lambda: PanelLight(SLANTED, np.zeros(3), np.array([0, 1.0, 0]), WARM), "right angles"),
        (lambda: EnvironmentLight(np.ones((8, 8, 3))), "shape"),
        (lambda: EnvironmentLight(np.ones((2, 4, 3))), "4 rows"),
        (lambda: EnvironmentLight(np.full((8, 16, 3), np.inf)), "finite"),
    ],
)
def test_impossible_lights_are_refused(make: Callable[[], Light], words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()
