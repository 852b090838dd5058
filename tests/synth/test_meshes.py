"""Swept surfaces and the demo's gourd: closed, oriented outward, albedo in range."""

from pathlib import Path

import numpy as np
import trimesh

from synth.scene.meshes import Mesh, swept, write_ply
from synth.shapes.gourd import gourd, gourd_albedo


def unit_sphere(rows: int = 61, columns: int = 121) -> Mesh:
    polar = np.linspace(0, np.pi, rows)[:, None]
    angle = np.linspace(0, 2 * np.pi, columns)[None]
    up = np.broadcast_to(np.cos(polar), (rows, columns))
    return swept(np.stack([np.sin(polar) * np.sin(angle), up, np.sin(polar) * np.cos(angle)], -1))


def test_normals_of_a_sphere_point_along_its_radius() -> None:
    sphere = unit_sphere()
    np.testing.assert_allclose(sphere.normals, sphere.vertices, atol=2e-3)


def test_faces_of_a_sphere_enclose_its_volume_and_wind_outward() -> None:
    sphere = unit_sphere()
    a, b, c = (sphere.vertices[sphere.faces[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    np.testing.assert_allclose(volume, 4 / 3 * np.pi, rtol=5e-3)


def test_turning_tips_the_top_toward_the_viewer() -> None:
    turned = unit_sphere().turned(90)
    np.testing.assert_allclose(turned.vertices[0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(turned.normals, turned.vertices, atol=2e-3)


def test_the_gourd_is_finite_closed_and_smooth() -> None:
    mesh = gourd()
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=-1), 1, atol=1e-9)
    corners = mesh.vertices[mesh.faces]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    solid = np.linalg.norm(facing, axis=-1) > 1e-12
    agreement = (
        np.einsum("ij,ij->i", facing, mesh.normals[mesh.faces[:, 0]])[solid]
        / np.linalg.norm(facing, axis=-1)[solid]
    )
    assert agreement.min() > 0.5
    assert np.quantile(agreement, 0.05) > 0.98


def test_ply_files_are_read_back_by_others(tmp_path: Path) -> None:
    mesh = gourd(rows=40, columns=61)
    write_ply(tmp_path / "gourd.ply", mesh)
    read = trimesh.load(tmp_path / "gourd.ply", process=False)
    np.testing.assert_allclose(read.vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(read.faces, mesh.faces)


def test_the_skin_is_colourful_and_physical_and_joins_around() -> None:
    skin = gourd_albedo(256)
    assert skin.shape == (128, 256, 3)
    assert skin.min() >= 0.02
    assert skin.max() <= 0.8
    hue = skin / skin.sum(-1, keepdims=True)
    assert hue.std(axis=(0, 1)).min() > 0.05
    seam = np.abs(skin[:, 0] - skin[:, -1]).mean()
    inside = np.abs(np.diff(skin, axis=1)).mean(axis=(0, 2)).max()
    assert seam <= inside
