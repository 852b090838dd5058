"""Geometry that the sources of bodies share, against closed forms."""

import numpy as np
import pytest

from tests.angles import degrees_between
from training.world.bodies.body import finished
from training.world.bodies.geometry.creases import creased
from training.world.bodies.geometry.edges import shared_edges
from training.world.bodies.geometry.forms import ball, placed, revolved, rounded_box, sheet, tube
from training.world.bodies.geometry.implicit import Ellipsoid, Limb, blended
from training.world.bodies.geometry.noise import cells, facets, fractal, noise
from training.world.bodies.geometry.parts import largest_piece
from training.world.bodies.geometry.surface import (
    Surface,
    fitted,
    in_fixed_order,
    together,
    welded,
)
from training.world.bodies.geometry.winding import consistently_wound

CUBE = rounded_box(np.ones(3), 0.0, 1)


def volume(surface: Surface) -> float:
    a, b, c = np.moveaxis(surface.corners(), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def grid(count: int) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(-1, 1, count), np.linspace(1, -1, count))
    return np.stack([x, y, 0 * x], -1)


FORMS = {
    "ball": (ball(24), 4 / 3 * np.pi),
    "box": (rounded_box(np.array([1, 0.5, 0.25]), 0.0, 4), 1.0),
    "tube": (tube(np.array([[0, 0, 0], [0, 2.0, 0]]), np.full(2, 0.3), 64), 0.18 * np.pi),
    "cylinder": (revolved(np.array([[0, 0], [1, 0], [1, 2], [0, 2]]), 128), 2 * np.pi),
    "sheet": (sheet(grid(9), 0.1), 0.4),
    "blend": (
        blended([Limb((0, 0, 0), (0, 1, 0), 0.4, 0.4)], 0.02),
        0.16 * np.pi + 0.256 / 3 * np.pi,
    ),
    "ellipsoid": (blended([Ellipsoid((0, 0, 0), (1, 0.5, 0.5))], 0.02), np.pi / 3),
}


@pytest.mark.parametrize("name", FORMS)
def test_forms_are_closed_outward_and_of_known_volume(name: str) -> None:
    surface, expected = FORMS[name]
    edges = shared_edges(surface.faces)
    assert edges.boundary == 0 and edges.opposite.all()
    rounding = 0.036 * np.pi if name == "tube" else 0  # its round ends
    assert expected * 0.96 <= volume(surface) <= (expected + rounding) * 1.04


def test_winding_is_mended_and_turned_outward() -> None:
    rng = np.random.default_rng(0)
    pair = together([ball(6), placed(CUBE, (4, 0, 0))])
    over = rng.random(len(pair.faces)) < 0.4
    mixed = Surface(pair.vertices, np.where(over[:, None], pair.faces[:, ::-1], pair.faces))
    mended = consistently_wound(mixed)
    assert shared_edges(mended.faces).opposite.all()
    assert volume(mended) == pytest.approx(volume(pair))


def test_a_moebius_strip_stays_as_drawn() -> None:
    turn = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    ring = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], -1)
    across = 0.2 * np.stack(
        [np.cos(turn / 2) * np.cos(turn), np.sin(turn / 2), np.cos(turn / 2) * np.sin(turn)], -1
    )
    k = np.arange(20)
    first, second = 2 * k, 2 * k + 1
    third, fourth = np.roll(first, -1), np.roll(second, -1)
    third[-1], fourth[-1] = 1, 0
    faces = np.concatenate(
        [np.stack([first, second, third], -1), np.stack([second, fourth, third], -1)]
    )
    strip = Surface(np.stack([ring + across, ring - across], 1).reshape(-1, 3), faces)
    assert np.array_equal(consistently_wound(strip).faces, faces)


def test_a_cube_keeps_its_edges_and_a_ball_is_smooth() -> None:
    cube, sphere = creased(CUBE), creased(ball(16))
    assert len(cube.vertices) == 24
    assert np.allclose(np.sort(np.abs(cube.normals), axis=1), [0, 0, 1])
    assert len(sphere.vertices) == len(ball(16).vertices)
    assert (np.einsum("ij,ij->i", sphere.normals, sphere.vertices) > 0.999).all()


def test_a_bevel_does_not_bend_the_flat_face_beside_it() -> None:
    """A strip of 2 x 2, bent down by 90 degrees in three facets of .03 at either side."""
    turns = np.radians([15, 45, 75])
    steps = 0.03 * np.stack([np.cos(turns), -np.sin(turns)], 1)
    right = np.concatenate([[[1.0, 0.0]], [1.0, 0.0] + np.cumsum(steps, axis=0)])
    profile = np.concatenate([right[::-1] * (-1, 1), right])
    rows = [np.insert(profile, 1, y, axis=1) for y in (-1.0, 1.0)]
    vertices, n = np.concatenate(rows), len(profile)
    k = np.arange(n - 1)
    faces = np.concatenate([np.stack([k, k + 1, n + k], 1), np.stack([k + 1, n + k + 1, n + k], 1)])
    mesh = creased(Surface(vertices, faces))
    flat = np.abs(np.abs(mesh.vertices[:, 0]) - 1) < 1e-9
    faced = mesh.normals[flat] * np.sign(mesh.normals[flat, 2:])
    assert flat.sum() == 4 and degrees_between(faced, (0.0, 0.0, 1.0)).max() < 1


def test_welding_merges_vertices_and_drops_triangles_without_area() -> None:
    corners = CUBE.corners().reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    faces = np.concatenate([faces, faces[:2, ::-1], [[0, 0, 1]]])
    surface, kept = welded(Surface(corners, faces))
    assert len(surface.vertices) == 8
    assert kept.tolist() == list(range(12))


def test_finishing_does_not_depend_on_place_and_size() -> None:
    surface = together([CUBE, placed(ball(5), (1, 1, 1), 0.7)])
    first, second = finished(surface), finished(placed(surface, (10, -3, 5), 40.0))
    assert np.allclose(first.vertices, second.vertices)
    assert np.ptp(fitted(surface).vertices, axis=0).max() == pytest.approx(2)


def test_the_largest_piece_is_found() -> None:
    pair = together([ball(6), placed(CUBE, (9, 0, 0), 0.2)])
    assert len(largest_piece(pair).faces) == len(ball(6).faces)


def test_noise_has_its_deviation_and_facets_are_flat() -> None:
    points = np.random.default_rng(0).uniform(-5, 5, (4000, 3))
    for seed in range(3):
        values = noise(points, 1.0, np.random.default_rng(seed))
        assert abs(values.mean()) < 0.25 and 1.2 < values.std() < 1.8
    line = np.linspace(0, 3, 3001)[:, None] * np.array([[1.0, 0.3, 0.2]])
    rough = np.abs(np.diff(facets(line, 0.5, np.random.default_rng(0)), 2))
    assert np.quantile(rough, 0.9) < 0.05 * rough.max()  # bends at few places
    octaves = fractal(points, 1.0, 3, 0.5, np.random.default_rng(1))
    assert octaves.shape == (4000,)


def test_cells_are_distances() -> None:
    points = np.random.default_rng(0).uniform(0, 1, (500, 3))
    nearest, gap = cells(points, 0.2, np.random.default_rng(1))
    assert (nearest >= 0).all() and (gap >= 0).all() and nearest.max() < np.sqrt(3) * 1.5


def test_a_fixed_order_undoes_any_other() -> None:
    surface, rng = ball(5), np.random.default_rng(0)
    order = rng.permutation(len(surface.vertices))
    vertices = np.empty_like(surface.vertices)
    vertices[order] = surface.vertices + 1e-12
    faces = np.roll(order[surface.faces][rng.permutation(len(surface.faces))], 1, axis=1)
    first, second = in_fixed_order(surface), in_fixed_order(Surface(vertices, faces))
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.faces, second.faces)
    assert volume(first) == pytest.approx(volume(surface), rel=1e-4)
