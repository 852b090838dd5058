"""Meshes drawn from another side: against closed forms."""

import numpy as np
import pytest
from scipy import ndimage

from isc_core.result_files.turned_view import turned_view

SIDE = 100


def plane(slope: float = 0.0, size: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles, a square that rises to the right."""
    x, y = np.array([-1, 1, 1, -1]) * size / 2, np.array([-1, -1, 1, 1]) * size / 2
    return np.stack([x, y, slope * x], -1), np.array([[0, 1, 2], [0, 2, 3]])


def dome(radius: float = 40.0, count: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """A hemisphere toward the viewer: rings from its top to its rim."""
    down, around = np.meshgrid(
        np.linspace(0, np.pi / 2, count), np.linspace(0, 2 * np.pi, count), indexing="ij"
    )
    across = np.sin(down)
    places = np.stack([across * np.cos(around), across * np.sin(around), np.cos(down)], -1)
    first = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).reshape(-1)
    below = first + count
    faces = np.concatenate(
        [np.stack([first, below, below + 1], -1), np.stack([first, below + 1, first + 1], -1)]
    )
    return radius * places.reshape(-1, 3), faces


def test_a_square_that_faces_the_viewer_is_itself() -> None:
    vertices, faces = plane()
    view = turned_view(vertices, faces, vertices[:, :2], 0.0, SIDE, 1.0)
    expected = np.zeros((SIDE, SIDE))
    expected[20:80, 20:80] = 1
    np.testing.assert_array_equal(view.coverage, expected)
    column = np.arange(20, 80) + 0.5 - SIDE / 2
    np.testing.assert_allclose(view.values[50, 20:80, 0], column, atol=1e-9)
    np.testing.assert_allclose(view.values[20:80, 50, 1], -column, atol=1e-9)


@pytest.mark.parametrize(("yaw", "slope"), [(30.0, 0.0), (-30.0, 0.0), (30.0, 0.5), (-30.0, 0.5)])
def test_a_turned_plane_has_the_width_of_its_projection(yaw: float, slope: float) -> None:
    """x' = x cos + z sin, with z = slope x."""
    vertices, faces = plane(slope)
    view = turned_view(vertices, faces, vertices[:, :1], yaw, SIDE, 1.0)
    angle = np.radians(yaw)
    width = 60 * (np.cos(angle) + slope * np.sin(angle))
    assert view.coverage[50].sum() == pytest.approx(width, abs=0.51)
    across = view.values[50][view.coverage[50] == 1][:, 0]
    np.testing.assert_allclose(np.diff(across), 60 / width, atol=1e-6)


@pytest.mark.parametrize("yaw", [30.0, -30.0])
def test_the_outline_of_a_turned_hemisphere(yaw: float) -> None:
    """A circle on the side that comes to the front; half an ellipse, r cos 30 degrees wide, on the
    other.
    """
    vertices, faces = dome()
    view = turned_view(vertices, faces, vertices[:, :1], yaw, SIDE, 1.0)
    for row in (30, 50, 70):
        half = np.sqrt(40.0**2 - (row + 0.5 - SIDE / 2) ** 2)
        width = half * (1 + np.cos(np.radians(30)))
        assert view.coverage[row].sum() == pytest.approx(width, abs=1)


def test_the_middle_of_a_turned_hemisphere_is_the_place_that_faces_the_viewer() -> None:
    vertices, faces = dome()
    for yaw in (30.0, -30.0):
        view = turned_view(vertices, faces, vertices, yaw, SIDE, 1.0)
        nearness = view.values @ (-np.sin(np.radians(yaw)), 0, np.cos(np.radians(yaw)))
        row, column = np.unravel_index(np.argmax(nearness * (view.coverage == 1)), nearness.shape)
        x = view.values[row, column, 0]
        assert x == pytest.approx(-40 * np.sin(np.radians(yaw)), abs=2)


def test_the_nearer_of_two_squares_is_seen_in_any_order() -> None:
    (far, faces), (near, _) = plane(), plane(size=30.0)
    vertices = np.concatenate([far, near + (0, 0, 5)])
    values = np.repeat([[1.0], [2.0]], 4, axis=0)
    for order in (np.concatenate([faces, faces + 4]), np.concatenate([faces + 4, faces])):
        view = turned_view(vertices, order, values, 0.0, SIDE, 1.0)
        assert view.values[50, 50] == 2 and view.values[25, 25] == 1


def test_what_does_not_fit_is_drawn_smaller() -> None:
    vertices, faces = plane()
    view = turned_view(10 * vertices, faces, vertices[:, :1], 0.0, SIDE, 1.0, room=0.5)
    assert np.flatnonzero(view.coverage[50])[[0, -1]].tolist() == [25, 74]


def test_triangles_without_area_are_nothing() -> None:
    vertices = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]])
    view = turned_view(vertices, np.array([[0, 1, 2], [0, 0, 0]]), vertices, 0.0, SIDE, 1.0)
    assert not view.coverage.any() and not view.values.any()


def test_colours_are_averaged_rather_than_places_in_the_texture() -> None:
    """Where a square hides half of a pixel of another, the texture between their places is not
    seen.
    """
    (far, faces), (near, _) = plane(), plane(size=31.0)
    vertices = np.concatenate([far, near + (0, 0, 5)])
    both = np.concatenate([faces, faces + 4])
    places = np.repeat([[0.0, 0.0], [2.0, 0.0]], 4, axis=0)
    texture = np.array([0.0, 1.0, 0.0]).reshape(3, 1, 1)
    args = vertices, both, places, 0.0, SIDE, 1.0
    between = np.abs(turned_view(*args).values[..., 0] - 1) < 0.5
    assert between.any()
    assert turned_view(*args, texture=texture).values.max() < 1e-12


def test_colours_are_interpolated_in_the_texture() -> None:
    """As by SciPy, also at places beyond its border."""
    vertices, faces = plane()
    places = np.array([[8.0, -2], [8, 5], [-1, 5], [-1, -2]])
    texture = np.random.default_rng(2).random((7, 5, 2))
    view = turned_view(vertices, faces, places, 0.0, SIDE, 1.0, texture=texture)
    fine = (np.arange(120) + 0.5) / 120
    at = np.meshgrid(9 * fine - 1, 7 * fine - 2, indexing="ij")
    for channel in (0, 1):
        plane_of = texture[..., channel]
        expected = ndimage.map_coordinates(plane_of, at, order=1, mode="nearest")
        means = expected.reshape(60, 2, 60, 2).mean(axis=(1, 3))
        np.testing.assert_allclose(view.values[20:80, 20:80, channel], means, atol=1e-9)
