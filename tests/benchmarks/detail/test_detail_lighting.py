"""The light on measured bodies against closed forms: a ball in a uniform room, and under a lamp."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.detail.lighting import Gloss, Lamp, Room, outgoing_light, reaching_light
from synth.scene.meshes import Mesh
from synth.scene.tracing import Tracer
from synth.shapes.sphere_grid import sphere_grid
from training.world.views import camera_rays

SIDE = 32
MATT = Gloss(0.0, 1.0)


def light_of_ball(room: Room, gloss: Gloss) -> tuple[np.ndarray, np.ndarray]:
    """The light (N, 3) of a ball of albedo one half, and its normals."""
    vertices, faces = sphere_grid(64)
    tracer = Tracer(Mesh(vertices * 0.9, vertices, vertices[:, :2], faces))
    hits = tracer.hits(*camera_rays(SIDE, np.inf))
    position, normal = hits.position[hits.valid], hits.normal[hits.valid]
    mask, rng = hits.valid.reshape(SIDE, SIDE), np.random.default_rng(0)
    light = reaching_light(room, tracer, position, normal, mask, rng)
    fields = light.enlarged(SIDE)[:, hits.valid]
    albedo = np.full((len(normal), 3), 0.5)
    return outgoing_light(light, fields, normal, albedo, gloss, room), normal


def room_of(level: float, *lamps: Lamp) -> Room:
    return Room(np.full((32, 64, 3), level), np.eye(3), lamps)


def test_a_ball_in_a_uniform_room_shows_its_albedo() -> None:
    seen, _ = light_of_ball(room_of(2.0), MATT)
    # of ten thousand points the tracer takes a few for covered all around
    assert (np.abs(seen - 1) < 0.05).mean() > 0.99


def test_a_lamp_adds_the_cosine() -> None:
    lamp = Lamp(np.array([0.6, 0.0, 0.8]), np.pi * np.array([1.0, 0.5, 0.25]), 0.01)
    lit, normal = light_of_ball(room_of(1.0, lamp), MATT)
    plain, _ = light_of_ball(room_of(1.0), MATT)
    cosine = normal @ lamp.toward
    bright = cosine > 0.3  # rays near the shadow's edge may meet the facets of the ball
    added = 0.5 * cosine[bright, None] * (1.0, 0.5, 0.25)
    assert_allclose((lit - plain)[bright], added, atol=0.01)


def test_weak_gloss_stays_weak_at_the_rim() -> None:
    plain, normal = light_of_ball(room_of(1.0), MATT)
    shiny, _ = light_of_ball(room_of(1.0), Gloss(0.04, 0.4))
    added = (shiny - plain)[:, 0]
    assert np.quantile(added, 0.01) > 0
    assert added[normal[:, 2] > 0.95].max() < 0.04
    assert added.max() < 0.25
