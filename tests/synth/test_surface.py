"""The visible surface of a ball: position, normal, silhouette and reflectance against the
closed form.
"""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.errors import InputError
from synth.scene import Scene
from synth.scene.camera import FAR, Camera
from synth.scene.materials import Material
from synth.scene.meshes import Mesh
from synth.scene.surface import find_surface
from synth.scene.tracing import Tracer
from tests.synth.small_scenes import GREY, ball, seen

SIZE = 40
SCALE = SIZE / 2.2


def pixel_centres(size: int = SIZE) -> tuple[np.ndarray, np.ndarray]:
    """x and y of the pixels' centres, object units."""
    rows, columns = np.indices((size, size)) + 0.5
    return (columns - size / 2) * 2.2 / size, (size / 2 - rows) * 2.2 / size


def test_a_ball_through_an_orthographic_camera() -> None:
    rows = 181
    surface = seen(ball(rows), size=SIZE).surface
    x, y = pixel_centres()
    square = x * x + y * y
    sure = np.abs(np.sqrt(square) - 1) > 1e-3
    np.testing.assert_array_equal(surface.mask[sure], (square < 1)[sure])
    depth = np.sqrt(np.maximum(1 - square, 0))
    exact = np.stack([x, y, depth], -1)[surface.mask]
    np.testing.assert_allclose(surface.position[:, :2], exact[:, :2], atol=1e-5)
    # A chord lies below its arc by 1 - cos(half the angle): what a mesh can show, seen along a
    # slanting ray.
    chord = 1 - np.cos(np.pi / (rows - 1))
    assert (np.abs(surface.position[:, 2] - exact[:, 2]) * exact[:, 2]).max() < 2 * chord + 1e-5
    inner = exact[:, 2] > 0.3
    np.testing.assert_allclose(surface.normal[inner], exact[inner], atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(surface.normal, axis=1), 1, atol=1e-9)
    assert (surface.normal[:, 2] > 0).all()
    np.testing.assert_array_equal(surface.view, np.broadcast_to([0.0, 0, 1], exact.shape))


def test_pictures_of_points_keep_their_order() -> None:
    surface = seen(ball(61), size=SIZE).surface
    x, y = pixel_centres()
    picture = surface.image(surface.position, (7, 8, 9))
    assert picture.dtype == np.float32
    np.testing.assert_allclose(picture[..., 0][surface.mask], x[surface.mask], atol=1e-5)
    np.testing.assert_allclose(picture[..., 1][surface.mask], y[surface.mask], atol=1e-5)
    np.testing.assert_array_equal(
        picture[~surface.mask], np.broadcast_to((7, 8, 9), picture[~surface.mask].shape)
    )
    assert surface.image(surface.reflectance.gloss).shape == (SIZE, SIZE)


def test_a_pinhole_sees_less_of_a_ball_and_its_rays_meet() -> None:
    distance = 3.0
    surface = seen(ball(181), size=SIZE, distance=distance).surface
    eye = np.array([0.0, 0, distance])
    toward = eye - surface.position
    np.testing.assert_allclose(
        surface.view, toward / np.linalg.norm(toward, axis=1, keepdims=True), atol=1e-5
    )
    np.testing.assert_allclose(np.linalg.norm(surface.position, axis=1), 1, atol=1e-3)
    # The outline is where the line of sight touches: all that is seen lies before the polar plane z
    # = 1 / distance.
    assert surface.position[:, 2].min() > 1 / distance - 1e-3
    # That circle appears on the plane z = 0 with the radius of a tangent from the eye.
    radius = distance / np.sqrt(distance**2 - 1) * SCALE
    assert surface.mask.sum() == pytest.approx(np.pi * radius**2, rel=0.02)


def test_rays_of_a_camera_pass_through_their_pixels() -> None:
    for distance in (np.inf, 4.0):
        camera = Camera(10, 8, 5.0, distance)
        origins, directions = camera.rays(0.25, 0.75)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, atol=1e-12)
        met = origins - directions * (origins[..., 2:] / directions[..., 2:])
        rows, columns = np.indices((8, 10))
        np.testing.assert_allclose(met[..., 0], (columns + 0.25 - 5) / 5, atol=1e-9)
        np.testing.assert_allclose(met[..., 1], (4 - rows - 0.75) / 5, atol=1e-9)
        assert (origins[..., 2] == (distance if np.isfinite(distance) else FAR)).all()


def checkerboard(cells: int) -> Material:
    board = np.indices((cells, 2 * cells)).sum(0) % 2
    board = np.repeat(np.repeat(board, 8, 0), 8, 1).astype(float)
    return Material(np.repeat(board[..., None], 3, 2), "blinn_phong", 50.0, board)


def test_reflectance_finer_than_pixels_is_averaged() -> None:
    """Cells of a third of a pixel: a camera sees nearly their mean."""
    material = checkerboard(128)
    fine = seen(ball(181), material, size=SIZE)
    middle = fine.surface.normal[:, 2] > 0.6
    for values in (
        fine.surface.reflectance.albedo[middle, 0],
        fine.surface.reflectance.strength[middle],
    ):
        assert abs(values.mean() - 0.5) < 0.03
        assert values.std() < 0.5 * material.at(fine.surface.uv[middle]).strength.std()


def test_reflectance_coarser_than_pixels_stays_sharp_except_at_edges() -> None:
    material = checkerboard(8)
    surface = seen(ball(181), material, size=2 * SIZE).surface
    centre = material.at(surface.uv)
    middle = surface.normal[:, 2] > 0.6
    same = np.abs(surface.reflectance.albedo[middle, 0] - centre.albedo[middle, 0]) < 1e-9
    assert 0.4 < same.mean() < 0.95
    assert ((surface.reflectance.albedo >= 0) & (surface.reflectance.albedo <= 1)).all()
    np.testing.assert_array_equal(surface.reflectance.gloss, 50.0)


def test_reflectance_is_not_taken_from_the_background() -> None:
    """A small white ball before a large black one: at its silhouette the footprint covers both; the
    reflectance is that of the nearer one.
    """
    small, large = ball(61, 0.4), ball(61, 1.0)
    vertices = np.concatenate([small.vertices + (0, 0, 1.5), large.vertices])
    u = np.concatenate([np.full(len(small.uv), 0.25), np.full(len(large.uv), 0.75)])
    faces = np.concatenate([small.faces, large.faces + len(small.vertices)])
    both = Mesh(
        vertices,
        np.concatenate([small.normals, large.normals]),
        np.stack([u, np.full_like(u, 0.5)], -1),
        faces,
    )
    half = np.zeros((2, 4, 3))
    half[:, :2] = 1
    surface = seen(both, Material(half, "lambert"), size=SIZE).surface
    near = surface.position[:, 2] > 1.05
    assert near.sum() > 50
    np.testing.assert_allclose(surface.reflectance.albedo[near], 1)
    np.testing.assert_allclose(surface.reflectance.albedo[~near], 0)


def test_an_object_out_of_view_is_an_input_error() -> None:
    mesh = ball(31, 0.1)
    away = Mesh(mesh.vertices + (50, 0, 0), mesh.normals, mesh.uv, mesh.faces)
    with pytest.raises(InputError, match="not in view"):
        find_surface(Scene(away, Material(GREY), (), Camera(16, 16, 8.0)), Tracer(away))
