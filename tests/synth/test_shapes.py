"""Random objects: closed, smooth, of the promised size and pose, reproducible, and textured without
a seam on the visible side.
"""

from functools import cache

import numpy as np
import pytest
import trimesh

from isc_core.errors import InputError
from synth.scene.meshes import Mesh, vertex_normals
from synth.shapes import SHAPES, make_shape
from synth.shapes.blobby import Blobs
from synth.shapes.displaced import STYLES, displacement
from synth.shapes.extruded import KINDS, Extrusion, random_polygon, smooth_outline
from synth.shapes.fields import smooth_field
from synth.shapes.lathe import FORMS, lathe_form
from synth.shapes.reliefs import STYLES as RELIEFS
from synth.shapes.reliefs import relief_height
from synth.shapes.sphere_grid import sphere_grid
from synth.shapes.superquadric import Superquadric
from synth.shapes.texture_coordinates import from_directions

SEEDS = range(6)
every = pytest.mark.parametrize("name", SHAPES)


@cache
def made(name: str, seed: int) -> Mesh:
    return make_shape(name, np.random.default_rng(seed))


def corners(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return (
        mesh.vertices[mesh.faces[:, 0]],
        mesh.vertices[mesh.faces[:, 1]],
        mesh.vertices[mesh.faces[:, 2]],
    )


def facing(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """The faces' unit normals, and which faces have an area."""
    a, b, c = corners(mesh)
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    return across / np.maximum(length, 1e-300)[:, None], length > 1e-9


def assert_closed(mesh: Mesh) -> None:
    """Watertight and oriented outward, by trimesh; vertices split by textures or creases
    count as one.
    """
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    solid.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=9)
    whole = solid.faces
    solid.update_faces(
        (whole[:, 0] != whole[:, 1]) & (whole[:, 1] != whole[:, 2]) & (whole[:, 2] != whole[:, 0])
    )
    assert solid.is_watertight
    assert solid.volume > 0.01


@pytest.mark.slow
@every
def test_surfaces_are_closed_and_fine(name: str) -> None:
    for seed in range(2):
        mesh = made(name, seed)
        assert 40_000 <= len(mesh.faces) <= 150_000
        assert_closed(mesh)


@pytest.mark.slow
@every
def test_normals_are_unit_and_those_of_the_faces(name: str) -> None:
    for seed in SEEDS:
        mesh = made(name, seed)
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
        normal, solid = facing(mesh)
        agreement = np.stack([(mesh.normals[mesh.faces[:, i]] * normal).sum(1) for i in range(3)])[
            :, solid
        ]
        assert agreement.min() > 0.1  # at the edge of a slab, which is a crease on one side
        assert np.quantile(agreement, 0.03) > 0.95


@pytest.mark.slow
@every
def test_objects_are_centred_and_two_units_large(name: str) -> None:
    for seed in SEEDS:
        low, high = made(name, seed).vertices.min(0), made(name, seed).vertices.max(0)
        np.testing.assert_allclose(low + high, 0, atol=1e-9)
        assert (high - low)[:2].max() == pytest.approx(2)


@every
def test_the_same_seed_makes_the_same_object_and_another_seed_another(name: str) -> None:
    again = make_shape(name, np.random.default_rng(3))
    for part in ("vertices", "normals", "uv", "faces"):
        np.testing.assert_array_equal(getattr(again, part), getattr(made(name, 3), part))
    other = made(name, 4)
    assert (
        other.vertices.shape != again.vertices.shape
        or np.abs(other.vertices - again.vertices).max() > 0.01
    )


@every
def test_textures_have_no_seam_on_the_side_that_is_seen(name: str) -> None:
    for seed in SEEDS:
        mesh = made(name, seed)
        assert mesh.uv.min() >= 0 and mesh.uv.max() <= 1
        normal, solid = facing(mesh)
        front = mesh.uv[mesh.faces[solid & (normal[:, 2] > 0.1)]]
        jumps = np.linalg.norm(front - np.roll(front, 1, axis=1), axis=-1)
        # Around a corner of an outline, which is a few columns wide, the wall's texture turns with
        # the outline.
        assert (
            jumps.max() < (0.25 if name == "extruded" else 0.08) and np.quantile(jumps, 0.99) < 0.05
        )
        assert (
            front.reshape(-1, 2).std(0).min() > 0.05
        )  # and what is drawn is not squeezed to a line


def test_unknown_shapes_are_refused_with_the_known_ones() -> None:
    with pytest.raises(
        InputError,
        match="unknown shape 'teapot': choose superquadric, blobby, displaced, lathe, extruded",
    ):
        make_shape("teapot", np.random.default_rng(0))


def test_the_sphere_grid_is_a_closed_sphere() -> None:
    directions, faces = sphere_grid(24)
    assert len(directions) == 6 * 24**2 + 2
    sphere = Mesh(directions, directions, from_directions(directions), faces)
    assert_closed(sphere)
    assert (facing(sphere)[0] * directions[faces].mean(1)).sum(1).min() > 0.99


@pytest.mark.parametrize(("around", "upright"), [(1.0, 1.0), (0.3, 1.0), (0.2, 0.2), (1.2, 0.6)])
def test_superquadrics_satisfy_their_equation(around: float, upright: float) -> None:
    axes = (1.0, 0.7, 0.5)
    mesh = Superquadric(axes, around, upright).mesh()
    x, y, z = np.abs(mesh.vertices / axes).T
    level = (x ** (2 / around) + z ** (2 / around)) ** (around / upright) + y ** (2 / upright)
    np.testing.assert_allclose(level, 1, atol=1e-6)


def test_an_ellipsoid_has_the_normals_and_the_volume_of_one() -> None:
    axes = np.array([1.0, 0.7, 0.5])
    mesh = Superquadric((1.0, 0.7, 0.5), 1, 1).mesh()
    expected = mesh.vertices / axes**2
    np.testing.assert_allclose(
        mesh.normals, expected / np.linalg.norm(expected, axis=1, keepdims=True), atol=1e-9
    )
    a, b, c = corners(mesh)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(
        4 / 3 * np.pi * axes.prod(), rel=1e-3
    )


def test_blobs_satisfy_their_equation_and_one_alone_is_a_ball() -> None:
    centres = np.array([[0.4, 0, 0], [-0.3, 0.2, 0.1]])
    shapes = np.stack([np.eye(3) / 0.6, np.eye(3) / 0.5])
    vertices = Blobs(centres, shapes, 3.0).mesh().vertices
    far = np.stack(
        [((vertices - c) @ shape.T) ** 2 for c, shape in zip(centres, shapes, strict=True)]
    ).sum(-1)
    np.testing.assert_allclose(np.exp(3 * (1 - far)).sum(0), 1, atol=1e-9)
    ball = Blobs(centres[:1], shapes[:1], 3.0).mesh()
    np.testing.assert_allclose(np.linalg.norm(ball.vertices - centres[0], axis=1), 0.6, atol=1e-9)
    np.testing.assert_allclose(ball.normals, (ball.vertices - centres[0]) / 0.6, atol=1e-9)


@pytest.mark.parametrize("style", STYLES)
def test_every_kind_of_displacement_is_there_and_moderate(style: str) -> None:
    directions, _ = sphere_grid(40)
    height = displacement(directions, np.random.default_rng(1), style)
    assert 0.02 < height.std() < 0.3
    assert np.abs(height - height.mean()).max() < 1


@pytest.mark.parametrize("form", FORMS)
def test_every_turned_form_is_closed_and_has_its_normals(form: str) -> None:
    mesh = lathe_form(form, np.random.default_rng(1))
    assert_closed(mesh)
    normal, solid = facing(mesh)
    assert (mesh.normals[mesh.faces[:, 0]] * normal).sum(1)[solid].min() > 0.2


@pytest.mark.parametrize("seed", [10, 22, 41])
def test_a_bottle_whose_neck_is_too_narrow_for_a_wall_is_solid(seed: int) -> None:
    mesh = lathe_form("bottle", np.random.default_rng(seed))
    assert_closed(mesh)
    normal, solid = facing(mesh)
    assert (mesh.normals[mesh.faces[:, 0]] * normal).sum(1)[solid].min() > 0.2


@pytest.mark.parametrize("kind", KINDS)
def test_every_extruded_outline_is_seen_whole_from_its_middle(kind: str) -> None:
    for seed in range(30):
        outline, normal, tightest = smooth_outline(
            random_polygon(kind, np.random.default_rng(seed)), 0.05
        )
        assert (outline * normal).sum(1).min() > 0
        assert tightest > 0.01


def test_an_extruded_square_has_the_extents_and_volume_of_one() -> None:
    square = np.array([[1.0, -1], [1, 1], [-1, 1], [-1, -1]])
    mesh = Extrusion(square, depth=0.8, rounding=0.02, edge=0.01).mesh()
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [2, 2, 0.8], rtol=1e-2)
    a, b, c = corners(mesh)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(4 * 0.8, rel=1e-2)


@pytest.mark.parametrize("style", RELIEFS)
def test_every_kind_of_relief_is_there_and_moderate(style: str) -> None:
    place = np.stack(np.meshgrid(np.linspace(-1, 1, 60), np.linspace(1, -1, 60)), -1)
    height = relief_height(place, np.random.default_rng(2), style)
    assert 0.01 < height.std() < 0.3


def test_smooth_fields_have_mean_0_variance_1_and_the_requested_wavelength() -> None:
    line = np.stack([np.linspace(0, 40, 4001), np.zeros(4001)], -1)
    fields = np.stack(
        [smooth_field(line, np.random.default_rng(seed), 0.5, spread=0) for seed in range(60)]
    )
    assert abs(fields.mean()) < 0.1
    assert fields.var() == pytest.approx(1, abs=0.1)
    # Of waves in all directions of the plane the mean squared slope along a line is (2 pi f)^2 / 2.
    assert (np.diff(fields, axis=1) / 0.01).var() == pytest.approx((np.pi) ** 2 / 2, rel=0.1)


def test_vertex_normals_of_a_sphere_are_its_radii() -> None:
    directions, faces = sphere_grid(60)
    np.testing.assert_allclose(vertex_normals(directions, faces), directions, atol=1e-9)
