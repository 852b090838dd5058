"""Traced views of bodies whose shape is known."""

from dataclasses import fields

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from isc_core.errors import InputError
from synth.scene.camera import Camera
from synth.scene.meshes import Mesh, swept
from training.world.views import (
    DIRECTIONS,
    FILL,
    LOWEST,
    SIDE,
    View,
    camera_rays,
    random_side,
    spread_directions,
    trace_view,
)


def ellipsoid(half: tuple[float, float, float]) -> Mesh:
    turn, polar = np.meshgrid(np.linspace(0, 2 * np.pi, 129), np.linspace(0, np.pi, 65))
    place = [np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)]
    return swept(np.stack(place, -1) * half)


def seen(mesh: Mesh, near: bool) -> View:
    for seed in range(20):
        view = trace_view("body", "made", mesh, np.random.default_rng(seed))
        if np.isfinite(view.distance) == near:
            return view
    raise AssertionError


def places(view: View) -> np.ndarray:
    rows, columns = np.nonzero(view.mask)
    across = np.stack([columns + 0.5, SIDE - rows - 0.5], 1) * (2 / SIDE) - 1
    depth = view.depth.astype(float)[:, None]
    return np.hstack([across * (1 - depth / view.distance), depth])


@pytest.mark.slow
@pytest.mark.parametrize("near", [False, True])
def test_a_ball_is_seen_as_a_ball(near: bool) -> None:
    view = seen(ellipsoid((1, 1, 1)), near)
    place, normal = places(view), view.normal.astype(float)
    for axis in (0, 1):
        reached = np.flatnonzero(view.mask.any(axis))
        assert len(reached) == pytest.approx(FILL * SIDE, abs=2)
        assert (reached[0] + reached[-1]) / 2 == pytest.approx((SIDE - 1) / 2, abs=1)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=2e-3)
    # The ball that fits the places best is the one of the normals.
    unknown = np.hstack([2 * place, np.ones((len(place), 1))])
    *centre, rest = np.linalg.lstsq(unknown, (place**2).sum(1), rcond=None)[0]
    radius = np.sqrt(rest + np.dot(centre, centre))
    # At the outline an interpolated normal may face away, and is turned round by the tracer.
    right = (np.abs((place - centre) / radius - normal) < 5e-3).all(1)
    assert right.mean() > 0.999
    place, normal = place[right], normal[right]
    eye = np.array([0, 0, view.distance if near else 1e6])
    toward = (eye - place) / np.linalg.norm(eye - place, axis=1, keepdims=True)
    chord = 2 * radius * (normal * toward).sum(1)
    assert np.abs(view.thickness[right] - chord).max() < 0.04
    open_to = np.unpackbits(view.visible, axis=1)[right]
    facing = normal @ view.directions.T
    assert (open_to[facing > 0.05] == 1).all() and (open_to[facing < -0.05] == 0).all()


def test_most_bodies_stand_and_are_seen_from_above() -> None:
    sides = [random_side(np.random.default_rng(seed)) for seed in range(400)]
    standing = [(side, up) for side, up in sides if up.any()]
    assert 0.6 < len(standing) / len(sides) < 0.8
    for side, up in standing:
        np.testing.assert_array_equal(side @ (0, 1, 0), up)
        assert np.degrees(np.arcsin(up[2])) == pytest.approx(25, abs=36)
        assert abs(up[0]) < 0.3 and up[1] > 0.4
    front = np.array([side[:, 2] for side, _ in standing])
    assert np.abs(front[:, [0, 2]].mean(0)).max() < 0.2  # turned anyhow about their own axis


def test_a_view_repeats_with_its_seed() -> None:
    slim = ellipsoid((0.1, 1, 0.1))
    first, again, other = (
        trace_view("slim", "made", slim, np.random.default_rng(seed)) for seed in (3, 3, 4)
    )
    for field in fields(View):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(again, field.name))
    assert first.mask.shape == other.mask.shape and (first.mask != other.mask).any()
    count = int(first.mask.sum())
    assert first.normal.shape == (count, 3) and first.visible.shape == (count, DIRECTIONS // 8)
    assert first.depth.shape == first.thickness.shape == (count,)


@pytest.mark.parametrize("distance", [np.inf, 4.0])
def test_the_rays_are_those_of_the_renderer(distance: float) -> None:
    origins, directions = camera_rays(SIDE, distance)
    theirs = [part.reshape(-1, 3) for part in Camera(SIDE, SIDE, SIDE / 2, distance).rays()]
    np.testing.assert_allclose(directions, theirs[1], atol=1e-12)
    np.testing.assert_allclose(origins[:, :2], theirs[0][:, :2], atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_directions_are_evenly_spread_over_their_cap(seed: int) -> None:
    directions = spread_directions(np.random.default_rng(seed))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, rtol=1e-12)
    assert directions.shape == (DIRECTIONS, 3) and directions[:, 2].min() > LOWEST
    nearest = np.sort(np.degrees(np.arccos(np.clip(directions @ directions.T, -1, 1))))[:, 1]
    assert nearest.min() > 14 and nearest.max() < 26
    np.testing.assert_allclose(directions.mean(0), (0, 0, (1 + LOWEST) / 2), atol=0.02)


def test_a_body_without_area_is_refused() -> None:
    vertices = np.array([[-1.0, 0, 0], [0, 0, 0], [1.0, 0, 0]])
    line = Mesh(vertices, np.tile([0.0, 0, 1], (3, 1)), np.zeros((3, 2)), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="line: no side shows enough of its surface"):
        trace_view("line", "made", line, np.random.default_rng(0))
