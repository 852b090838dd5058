"""Results with a perspective camera: the record of the camera, the mesh and the arrays."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.photo.camera import Camera
from isc_core.result_files.arrays_file import arrays_of, mesh_of
from isc_core.result_files.mesh.options import MeshOptions
from isc_core.result_files.mesh.result import MeshResult
from isc_core.result_files.result_folder import load, save
from isc_core.scene.part_of_result import ResultPart
from isc_core.shading.perspective import lifted_points, object_axis, view_directions
from tests.core.perspective_scene import CAMERA, bump_before_camera


def description(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "decomposition.json").read_text(encoding="utf-8")))


def seen_at(built: MeshResult, camera: Camera) -> np.ndarray:
    """Row and column (V, 2) at which a camera at the mesh's eye sees its vertices."""
    assert built.eye is not None
    x, y, z = (built.mesh.vertices - built.eye).T
    (across, down), focal = camera.principal_point, camera.focal_length
    return np.stack([down + focal * y / z - 0.5, across - focal * x / z - 0.5], -1)


def test_a_saved_result_keeps_its_camera(tmp_path: Path) -> None:
    d = bump_before_camera()
    save(d, tmp_path / "bump")
    again = load(tmp_path / "bump")
    assert again.camera == d.camera
    assert again.identity_errors().broken() == ()
    record = description(tmp_path / "bump")["camera"]
    assert record["type"] == "perspective"
    assert record["source"] == "exif"
    assert record["focal_length"] == CAMERA.focal_length
    assert record["principal_point"] == list(CAMERA.principal_point)
    assert record["axis"] == pytest.approx(object_axis(CAMERA, d.mask).tolist())


def test_an_orthographic_result_is_recorded(tmp_path: Path) -> None:
    save(bump_before_camera(None), tmp_path / "bump")
    assert description(tmp_path / "bump")["camera"] == {"type": "orthographic", "source": "none"}
    assert load(tmp_path / "bump").camera is None


def test_results_without_a_record_are_orthographic(tmp_path: Path) -> None:
    save(bump_before_camera(None), tmp_path / "bump")
    path = tmp_path / "bump" / "decomposition.json"
    before = description(tmp_path / "bump")
    del before["camera"]
    path.write_text(json.dumps(before), encoding="utf-8")
    assert load(tmp_path / "bump").camera is None


@pytest.mark.parametrize(
    "record",
    [
        "wide",
        {"type": "fisheye"},
        {"type": "perspective"},
        {"type": "perspective", "source": "exif", "focal_length": 0, "principal_point": [1, 2]},
        {"type": "perspective", "source": "exif", "focal_length": 9, "principal_point": [1]},
        {"type": "perspective", "source": "moon", "focal_length": 9, "principal_point": [1, 2]},
        {"type": "perspective", "source": [], "focal_length": 9, "principal_point": [1, 2]},
        {"type": [], "source": "exif", "focal_length": 9, "principal_point": [1, 2]},
    ],
)
def test_a_damaged_record_is_refused(tmp_path: Path, record: Any) -> None:
    save(bump_before_camera(), tmp_path / "bump")
    path = tmp_path / "bump" / "decomposition.json"
    changed = description(tmp_path / "bump") | {"camera": record}
    path.write_text(json.dumps(changed), encoding="utf-8")
    with pytest.raises(InputError, match="no usable camera") as caught:
        load(tmp_path / "bump")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("faces", [525_000, 400])
def test_vertices_lie_on_the_rays_of_their_pixels(faces: int) -> None:
    d = bump_before_camera()
    built = mesh_of(ResultPart.of(d), MeshOptions(triangles=faces))
    assert len(built.mesh.faces) <= faces
    np.testing.assert_allclose(seen_at(built, CAMERA), built.vertex_pixel, atol=1e-9)


def test_the_mesh_is_the_height_before_the_camera() -> None:
    """Without a limited rim, the mesh is the lifted height but for size and place."""
    d = bump_before_camera()
    built = mesh_of(ResultPart.of(d), MeshOptions(rim=0))
    row, column = built.vertex_pixel.T
    points = lifted_points(d.height.astype(float), CAMERA, object_axis(CAMERA, d.mask))
    assert built.eye is not None
    placed = (built.mesh.vertices - built.eye) / built.metres_per_pixel
    ratio = placed[:, 2] / points[row, column, 2]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    assert placed[:, 2].mean() == pytest.approx(-CAMERA.focal_length)
    side = np.ptp(np.argwhere(d.mask), axis=0).max() + 1
    assert np.ptp(built.mesh.vertices[:, :2], axis=0).max() == pytest.approx(0.1, rel=0.3)
    assert built.metres_per_pixel == pytest.approx(0.1 / side)
    column_of_origin, row_of_origin, _ = built.origin
    x, y, z = -built.eye
    assert column_of_origin == pytest.approx(42 - 62 * x / z - 0.5)
    assert row_of_origin == pytest.approx(30 + 62 * y / z - 0.5)


def test_faces_and_normals_face_the_camera() -> None:
    d = bump_before_camera()
    built = mesh_of(ResultPart.of(d))
    assert built.eye is not None
    corners = built.mesh.vertices[built.mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((built.eye - corners.mean(1)) * across).sum(-1).min() > 0
    row, column = built.vertex_pixel.T
    np.testing.assert_allclose(built.mesh.vertex_normals, d.normal[row, column], atol=1e-6)
    unit = across / np.linalg.norm(across, axis=-1, keepdims=True)
    recovered = built.mesh.vertex_normals[built.mesh.faces].mean(1)
    assert np.median((unit * recovered).sum(-1)) > 0.99, "the geometry has the recovered normals"


def test_the_normal_map_restores_the_recovered_normals() -> None:
    """Tangent frames are those of renderers: the direction in which u grows on the surface."""
    d = bump_before_camera()
    built = mesh_of(ResultPart.of(d), MeshOptions(triangles=400))
    assert len(built.mesh.faces) <= 400
    row, column = built.vertex_pixel.T
    base = built.mesh.vertex_normals
    view = view_directions(CAMERA, (d.mask.shape[0], d.mask.shape[1]))[row, column]
    tangent = np.cross(base, np.cross((1.0, 0, 0), view))
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(base, tangent), base], -1)
    detail = built.detail[row, column].astype(float)
    restored = np.einsum("vij,vj->vi", frame, detail)
    covered = np.abs(detail - (0, 0, 1)).max(1) > 0  # flat beside the cells of the mesh
    assert covered.mean() > 0.6
    np.testing.assert_allclose(restored[covered], d.normal[row, column][covered], atol=1e-5)


def test_arrays_hold_the_camera_only_where_there_is_one() -> None:
    names = {"focal_length", "principal_point", "eye"}
    d, flat = bump_before_camera(), bump_before_camera(None)
    arrays = arrays_of(d, mesh_of(ResultPart.of(d)))
    assert names <= set(arrays)
    assert arrays["focal_length"] == np.float32(62)
    assert names.isdisjoint(arrays_of(flat, mesh_of(ResultPart.of(flat))))
