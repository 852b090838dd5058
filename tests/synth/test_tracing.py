"""Rays against a ball: hits and occlusion, in both kinds of variant."""

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from synth.scene.tracing import LIFT, Tracer
from synth.scene.variant import is_vectorised, load_mitsuba
from tests.synth.small_scenes import ball, skittle


@pytest.fixture(params=["usual", "scalar"], scope="module")
def sphere(request: pytest.FixtureRequest) -> Iterator[Tracer]:
    mi = load_mitsuba()
    usual = mi.variant()
    if request.param == "scalar":
        if not is_vectorised():
            pytest.skip("the usual variant is the scalar one here")
        mi.set_variant("scalar_rgb")
    yield Tracer(ball(181))
    mi.set_variant(usual)


def rays_around(count: int = 500) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays past the origin, and how far from it they pass."""
    rng = np.random.default_rng(0)
    origins = rng.normal(size=(count, 3))
    origins *= 3 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = -origins / 3 + 0.4 * rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return origins, directions, np.linalg.norm(np.cross(origins, directions), axis=1)


def test_hits_are_those_of_a_ball(sphere: Tracer) -> None:
    origins, directions, passes = rays_around()
    hits = sphere.hits(origins, directions)
    sure = np.abs(passes - 1) > 1e-3  # at the outline the mesh decides
    assert 0.2 < hits.valid.mean() < 0.95
    np.testing.assert_array_equal(hits.valid[sure], passes[sure] < 1)
    inner = hits.valid & (passes < 0.95)
    along = -(origins * directions).sum(1) - np.sqrt(np.maximum(1 - passes**2, 0))
    exact = origins + along[:, None] * directions
    # A facet's middle lies below the ball by the square of its angle over 8, and more along a
    # slanting ray.
    np.testing.assert_allclose(hits.position[inner], exact[inner], atol=1e-3)
    np.testing.assert_allclose(hits.normal[inner], exact[inner], atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(hits.normal[inner], axis=1), 1, atol=1e-9)
    polar = np.arccos(np.clip(exact[inner, 1], -1, 1)) / np.pi
    np.testing.assert_allclose(hits.uv[inner, 1], polar, atol=2e-3)
    assert not hits.position[~hits.valid].any() and not hits.uv[~hits.valid].any()


def test_normals_from_inside_face_the_ray(sphere: Tracer) -> None:
    origins, directions = np.zeros((1, 3)), np.array([[0.0, 0.6, 0.8]])
    hits = sphere.hits(origins, directions)
    assert hits.valid.all()
    np.testing.assert_allclose(hits.normal, -directions, atol=1e-3)


def test_what_is_beyond_the_light_is_not_in_its_way(sphere: Tracer) -> None:
    origins = np.tile([0.0, 0.0, 3.0], (4, 1))
    directions = np.array([[0.0, 0, -1], [0, 0, -1], [0, 0, -1], [0, 1, 0]])
    np.testing.assert_array_equal(
        sphere.blocked(origins, directions, np.array([1.9, 2.1, np.inf, np.inf])),
        [False, True, True, False],
    )
    np.testing.assert_array_equal(
        sphere.blocked(origins, directions, np.inf), [True, True, True, False]
    )


def test_lifted_rays_leave_the_surface_and_do_not_pass_through_it(sphere: Tracer) -> None:
    normals = rays_around()[0] / 3
    hits = sphere.hits(3 * normals, -normals)
    lifted = hits.position + LIFT * hits.normal
    assert not sphere.blocked(lifted, hits.normal, np.inf).any()
    assert sphere.blocked(lifted, -hits.normal, np.inf).all()


def test_no_rays_are_no_error(sphere: Tracer) -> None:
    none = np.zeros((0, 3))
    hits = sphere.hits(none, none)
    assert [part.shape for part in (hits.valid, hits.position, hits.normal, hits.uv)] == [
        (0,),
        (0, 3),
        (0, 3),
        (0, 2),
    ]
    assert sphere.blocked(none, none, np.inf).shape == (0,)


@pytest.mark.slow
def test_a_waist_hides_itself() -> None:
    tracer = Tracer(skittle())
    below, up = np.array([[0.0, 0.0, 5.0]]), np.array([[0.0, 0.0, -1.0]])
    assert tracer.blocked(below, up, np.inf).all()
    hit = tracer.hits(below, up)
    assert tracer.blocked(
        hit.position + LIFT * hit.normal, np.array([[0.0, 1.0, 0.0]]), np.inf
    ).all()
