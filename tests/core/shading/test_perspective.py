"""Surfaces seen by a perspective camera, against closed forms."""

import numpy as np
import pytest

from isc_core.photo.camera import Camera
from isc_core.shading.perspective import (
    far_view_normals,
    lifted_normals,
    lifted_points,
    object_axis,
    rotation_between,
    view_directions,
)
from isc_core.shading.spherical_harmonics import normal_from_reference
from isc_core.shading.surface_stencils import normals

SHAPE = (60, 84)
CAMERA = Camera(62.0, (40.3, 31.1))
MASK = np.zeros(SHAPE, bool)
MASK[8:40, 45:80] = True
AXIS = object_axis(CAMERA, MASK)


def unit(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def test_points_are_seen_at_the_centres_of_their_pixels() -> None:
    height = np.random.default_rng(0).normal(0, 20, SHAPE)
    x, y, z = np.moveaxis(lifted_points(height, CAMERA, AXIS), -1, 0)
    assert z.max() < 0, "in front of the camera"
    row, column = np.indices(SHAPE)
    np.testing.assert_allclose(40.3 + 62 * x / -z, column + 0.5, atol=1e-9)
    np.testing.assert_allclose(31.1 - 62 * y / -z, row + 0.5, atol=1e-9)


def test_height_zero_is_the_plane_that_faces_the_camera_at_the_object() -> None:
    points = lifted_points(np.zeros(SHAPE), CAMERA, AXIS)
    np.testing.assert_allclose(points @ AXIS, 62.0, rtol=1e-12)
    np.testing.assert_allclose(
        lifted_normals(np.zeros(SHAPE), CAMERA, AXIS),
        np.broadcast_to(-AXIS, (*SHAPE, 3)),
        atol=1e-9,
    )


def test_small_heights_count_along_the_axis() -> None:
    flat, raised = (lifted_points(np.full(SHAPE, h), CAMERA, AXIS) @ AXIS for h in (0.0, 0.01))
    np.testing.assert_allclose(flat - raised, 0.01, rtol=1e-3)


def test_normals_are_those_of_the_points() -> None:
    row, column = np.indices(SHAPE)
    height = 6 * np.sin(column / 9) * np.cos(row / 11) + 0.2 * column
    fine = lifted_points(height, CAMERA, AXIS)
    right, down = (np.gradient(fine, axis=axis)[2:-2, 2:-2] for axis in (1, 0))
    found = lifted_normals(height, CAMERA, AXIS)[2:-2, 2:-2]
    expected = unit(np.cross(down, right))
    assert np.degrees(np.arccos(np.clip((found * expected).sum(-1), -1, 1))).max() < 0.5


def test_every_normal_faces_its_camera_and_a_silhouette_is_seen_edge_on() -> None:
    height = np.random.default_rng(1).normal(0, 50, SHAPE)
    view = view_directions(CAMERA, SHAPE)
    assert (lifted_normals(height, CAMERA, AXIS) * view).sum(-1).min() > 0
    column = np.indices(SHAPE)[1]
    cliff = lifted_normals(1e6 * (column - 40.0), CAMERA, AXIS)[1:-1, 1:-1]
    assert np.abs((cliff * view[1:-1, 1:-1]).sum(-1)).max() < 1e-5


def test_a_long_lens_gives_the_orthographic_view() -> None:
    height = np.random.default_rng(2).normal(0, 3, SHAPE)
    far = Camera(1e7, (42, 30))
    axis = object_axis(far, MASK)
    np.testing.assert_allclose(
        lifted_normals(height, far, axis), normal_from_reference(normals(height)), atol=1e-4
    )
    x, _, z = np.moveaxis(lifted_points(height, far, axis), -1, 0)
    np.testing.assert_allclose(z - z.mean(), height - height.mean(), atol=0.01)
    np.testing.assert_allclose(np.diff(x, axis=1), 1, atol=1e-4)


def test_a_ball_whose_dome_is_recovered_gets_better_normals_than_an_orthographic_one() -> None:
    """A ball 15 degrees beside the middle of a phone's photo: a dome over its outline."""
    camera = Camera(260.0, (160, 120))
    view = view_directions(camera, (240, 320))
    centre = 4.0 * unit(np.array([0.26, 0.0, -1.0]))
    along = -(view @ centre)
    square = along**2 - (centre @ centre - 1)
    mask = square > 0
    points = -view * (along - np.sqrt(np.where(mask, square, 0)))[..., None]
    truth = unit(points - centre)
    row, column = np.nonzero(mask)
    (r, c), half = (row.mean(), column.mean()), np.sqrt(mask.sum() / np.pi)
    rows, columns = np.indices(mask.shape)
    dome = np.sqrt(np.maximum(half**2 - (rows - r) ** 2 - (columns - c) ** 2, 0))
    inner = mask & ((rows - r) ** 2 + (columns - c) ** 2 < (0.9 * half) ** 2)

    def error(found: np.ndarray) -> float:
        cosine = (found * truth).sum(-1)[inner]
        return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())

    flat = error(normal_from_reference(normals(dome)))
    lifted = error(lifted_normals(dome, camera, object_axis(camera, mask)))
    assert flat > 12
    assert lifted < 0.6 * flat


def test_the_rotation_between_two_directions() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        one, other = unit(rng.normal(size=(2, 3)))
        turn = rotation_between(one, other)
        np.testing.assert_allclose(turn @ one, other, atol=1e-12)
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)


def test_far_view_normals_mirror_the_same_light() -> None:
    rng = np.random.default_rng(4)
    normal, view = unit(rng.normal(size=(50, 3))), unit(rng.normal(size=(50, 3)) + (0, 0, 3))
    mirrored = 2 * (normal * view).sum(-1, keepdims=True) * normal - view
    found = far_view_normals(normal, view)
    again = 2 * found[:, 2:] * found - (0, 0, 1)
    np.testing.assert_allclose(again, mirrored, atol=1e-9)
    up = np.array([0.0, 0.0, 1.0])
    front = unit(rng.normal(size=(50, 3)) + (0, 0, 4))
    np.testing.assert_allclose(far_view_normals(front, up), front, atol=1e-12)
    assert far_view_normals(up[None], -up)[0] == pytest.approx(up)
