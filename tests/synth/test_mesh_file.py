"""Meshes from files: size, normals and colours are kept; meshes that cannot be rendered are refused
in one line.
"""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.srgb import srgb_to_linear
from synth.shapes import mesh_file
from synth.shapes.mesh_file import read_mesh, read_mesh_file

# A cube whose eight corners have one texture coordinate each: front to the left half, back to the
# right.
CUBE = """
v -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1
vt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\nvt 0.6 0\nvt 1 0\nvt 1 1\nvt 0.6 1
f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 6/6 5/5 8/8\nf 6/6 8/8 7/7\nf 2/2 6/6 7/7\nf 2/2 7/7 3/3
f 5/5 1/1 4/4\nf 5/5 4/4 8/8\nf 4/4 3/3 7/7\nf 4/4 7/7 8/8\nf 5/5 6/6 2/2\nf 5/5 2/2 1/1
"""


def obj(folder: Path, text: str = CUBE, name: str = "cube.obj") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def textured(folder: Path, image: str = "skin.png", extra: str = "") -> Path:
    (folder / "cube.mtl").write_text(f"newmtl skin\nKd 1 1 1\nmap_Kd {image}\n{extra}")
    return obj(folder, "mtllib cube.mtl\nusemtl skin\n" + CUBE)


def picture() -> np.ndarray:
    """Upper half red, lower half green, with a blue column on the left."""
    pixels = np.zeros((8, 16, 3), np.uint8)
    pixels[:4, :, 0], pixels[4:, :, 1] = 200, 100
    pixels[:, 0] = (0, 0, 255)
    return pixels


def refused(path: Path, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        read_mesh_file(path)
    assert path.name in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["ply", "stl", "off", "obj", "glb"])
def test_a_ball_of_any_kind_of_file_is_a_smooth_ball(kind: str, tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(4, radius=30)
    ball.apply_translation((100, -50, 7))
    ball.export(tmp_path / f"ball.{kind}")
    mesh = read_mesh(tmp_path / f"ball.{kind}")
    assert len(mesh.vertices) == len(
        ball.vertices
    )  # also where the file repeats them for each face
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 1, atol=1e-3)
    np.testing.assert_allclose(mesh.normals, mesh.vertices, atol=1e-2)
    assert np.ptp(mesh.vertices[:, :2], axis=0).max() == pytest.approx(2)
    assert mesh.uv.min() >= 0 and mesh.uv.max() <= 1


def test_a_cube_keeps_its_edges_and_a_prism_of_many_sides_is_round(tmp_path: Path) -> None:
    cube = read_mesh(obj(tmp_path))
    assert len(cube.vertices) == 24
    assert (np.abs(cube.normals).max(1) > 0.999).all()
    trimesh.creation.cylinder(1, 3, sections=24).export(tmp_path / "prism.stl")
    prism = read_mesh(tmp_path / "prism.stl")
    side = np.abs(prism.normals[:, 2]) < 0.5
    radial = prism.vertices[side] * (1, 1, 0)
    np.testing.assert_allclose(
        prism.normals[side], radial / np.linalg.norm(radial, axis=1, keepdims=True), atol=0.02
    )


def test_a_mesh_that_is_turned_inside_out_is_turned_back(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(3)
    ball.invert()
    ball.export(tmp_path / "ball.ply")
    mesh = read_mesh(tmp_path / "ball.ply")
    assert (mesh.normals * mesh.vertices).sum(1).min() > 0.9
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


def test_a_texture_is_read_as_linear_and_upright(tmp_path: Path) -> None:
    Image.fromarray(picture()).save(tmp_path / "skin.png")
    read = read_mesh_file(textured(tmp_path))
    assert read.albedo is not None
    np.testing.assert_allclose(read.albedo, srgb_to_linear(picture() / 255), atol=1e-6)
    front = np.isclose(read.mesh.normals[:, 2], 1)
    corner = read.mesh.vertices[front][:, :2] / 2 + 0.5
    np.testing.assert_allclose(
        read.mesh.uv[front], np.stack([corner[:, 0] / 2, 1 - corner[:, 1]], -1), atol=1e-6
    )


@pytest.mark.slow
def test_colours_of_vertices_are_projected_from_the_front(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(4)
    shade = np.clip((ball.vertices + 1) * 127.5, 0, 255).astype(np.uint8)
    ball.visual.vertex_colors = np.c_[shade, np.full(len(shade), 255)]
    ball.export(tmp_path / "ball.ply")
    read = read_mesh_file(tmp_path / "ball.ply")
    assert read.albedo is not None
    assert read.albedo.min() >= 0 and read.albedo.max() <= 1
    mesh, size = read.mesh, len(read.albedo)
    front = mesh.vertices[:, 2] > 0.3
    column, row = np.minimum((mesh.uv[front] * size).astype(int), size - 1).T
    np.testing.assert_allclose(
        read.albedo[row, column], srgb_to_linear((mesh.vertices[front] + 1) / 2), atol=0.03
    )


def test_pieces_of_different_colours_become_one_textured_mesh(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for x, colour in ((-1.5, (1.0, 0.0, 0.0, 1.0)), (1.5, (0.0, 0.25, 0.0, 1.0))):
        ball = trimesh.creation.icosphere(3)
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=colour)
        ball.visual = trimesh.visual.TextureVisuals(
            uv=np.zeros((len(ball.vertices), 2)), material=material
        )
        scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix((x, 0, 0)))
    scene.export(tmp_path / "pair.glb")
    read = read_mesh_file(tmp_path / "pair.glb")
    assert read.albedo is not None
    np.testing.assert_allclose(np.ptp(read.mesh.vertices, axis=0), [2, 0.8, 0.8], rtol=0.02)
    size = len(read.albedo)
    np.testing.assert_allclose(read.albedo[size // 2, size // 4], [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(read.albedo[size // 2, 3 * size // 4], [0, 0.25, 0], atol=2e-3)


def test_a_mesh_without_colours_has_no_albedo(tmp_path: Path) -> None:
    assert read_mesh_file(obj(tmp_path)).albedo is None


def test_files_beside_the_mesh_that_are_missing_or_elsewhere_are_named(tmp_path: Path) -> None:
    folder = tmp_path / "mesh"
    folder.mkdir()
    refused(textured(folder), "skin.png, which is missing")
    Image.fromarray(picture()).save(tmp_path / "secret.png")
    refused(textured(folder, "../secret.png"), "secret.png, which is not in its folder")
    refused(textured(folder, str(tmp_path / "secret.png")), "which is not in its folder")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    refused(textured(folder, "link.png"), "which is not in its folder")
    refused(textured(folder, "https://example.org/skin.png"), "which is missing")
    (folder / "skin.png").write_bytes(b"no picture")
    refused(textured(folder), "skin.png is not a readable image")
    refused(obj(folder, "mtllib other.mtl\n" + CUBE, "lone.obj"), "other.mtl, which is missing")


def test_a_gltf_file_refers_only_to_files_in_its_folder(tmp_path: Path) -> None:
    folder = tmp_path / "mesh"
    folder.mkdir()
    trimesh.creation.icosphere(2).export(tmp_path / "ball.glb")
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(trimesh.creation.icosphere(2)))
    tree = json.loads(files.pop("model.gltf"))
    for name, data in files.items():
        (folder / name).write_bytes(data)
    path = folder / "ball.gltf"
    path.write_text(json.dumps(tree))
    assert len(read_mesh(path).vertices) == 162
    uri = tree["buffers"][0]["uri"]
    for buffer in tree["buffers"]:
        (tmp_path / buffer["uri"]).write_bytes((folder / buffer["uri"]).read_bytes())
        buffer["uri"] = "../" + buffer["uri"]
    path.write_text(json.dumps(tree))
    refused(path, "which is not in its folder")
    for buffer in tree["buffers"]:
        data = (tmp_path / buffer["uri"][3:]).read_bytes()
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    path.write_text(json.dumps(tree))
    assert len(read_mesh(path).vertices) == 162
    tree["buffers"][0]["uri"] = uri
    (folder / uri).unlink()
    path.write_text(json.dumps(tree))
    refused(path, "which is missing")


def test_open_meshes_are_refused_with_their_open_edges(tmp_path: Path) -> None:
    refused(obj(tmp_path, CUBE.replace("f 1/1 2/2 3/3\n", "")), "open, 3 edges")
    ball = trimesh.creation.icosphere(2)
    ball.update_faces(ball.triangles_center[:, 2] > 0)
    ball.export(tmp_path / "half.ply")
    refused(tmp_path / "half.ply", "the mesh is open")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no triangles|not a readable"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles|not a readable"),
        (CUBE.replace("v -1 -1 1", "v nan -1 1"), "not finite"),
        (CUBE.replace("v -1 -1 1", "v inf -1 1"), "not finite"),
        ("v 2 2 2\nv 2 2 2\nv 2 2 2\nf 1 2 3\n", "no size"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 3 2\n", "no volume"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 3 2\n", "no volume"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2\n", "degenerate"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "not there|not a readable"),
        (CUBE.replace("f 1/1 2/2 3/3", "f 1/1 3/3 2/2"), "opposite orientations"),
    ],
)
def test_bad_meshes_are_refused(text: str, words: str, tmp_path: Path) -> None:
    refused(obj(tmp_path, text), words)


def test_files_that_are_no_meshes_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused(tmp_path / "absent.obj", "does not exist")
    refused(tmp_path / "shape.blend", "meshes are read from")
    junk = np.random.default_rng(0).bytes(4000)
    for kind in ("ply", "stl", "off", "glb", "gltf", "obj"):
        (tmp_path / f"junk.{kind}").write_bytes(junk)
        refused(tmp_path / f"junk.{kind}", "not a readable|no triangles")
    trimesh.creation.icosphere(2).export(tmp_path / "cut.glb")
    whole = (tmp_path / "cut.glb").read_bytes()
    (tmp_path / "cut.glb").write_bytes(whole[: len(whole) // 2])
    refused(tmp_path / "cut.glb", "not a readable")
    monkeypatch.setattr(mesh_file, "MOST_FACES", 10)
    refused(obj(tmp_path), "12 faces, at most 10")
