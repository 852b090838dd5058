"""Height maps: the camera sees the map pixel by pixel; invalid maps are refused."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from isc_core.errors import InputError
from isc_core.io.exr import write_channels
from synth.scene import Scene
from synth.scene.lights import DirectionalLight
from synth.scene.materials import Material
from synth.scene.surface import Surface, find_surface
from synth.scene.tracing import Tracer
from synth.shapes.height_field import (
    HeightField,
    check_height,
    mesh_of_height,
    place_height,
    read_height,
)


def bumpy_map(rows: int = 37, columns: int = 52) -> np.ndarray:
    """An object off the middle, with a hole, a thin limb, a lone pixel and a step of 9 pixels."""
    y, x = np.mgrid[:rows, :columns].astype(float)
    height = 200 + 6 * np.sin(x / 4) + 4 * np.cos(y / 3) + np.where(x > 24, 9.0, 0.0)
    inside = np.hypot(x - 20, y - 17) < 13
    inside[10, 15] = False
    inside[17, 30:45] = True
    inside[2, 48] = True
    return np.where(inside, height, np.nan)


def seen(field: HeightField) -> Surface:
    pytest.importorskip("mitsuba")
    light = DirectionalLight(np.array([0.0, 0, 1]), np.ones(3))
    scene = Scene(field.mesh, Material(np.full((1, 1, 3), 0.5), "lambert"), (light,), field.camera)
    return find_surface(scene, Tracer(field.mesh))


@pytest.mark.parametrize("shape", [(37, 52), (40, 53), (64, 64)])
def test_each_pixel_shows_its_own_height(shape: tuple[int, int]) -> None:
    height = bumpy_map(*shape)
    field = place_height(height)
    surface = seen(field)
    np.testing.assert_array_equal(surface.mask, np.isfinite(height))
    found = surface.position[:, 2] * field.pixels_per_unit + field.offset
    np.testing.assert_allclose(found, height[surface.mask], atol=1e-4)


def test_normals_at_pixel_centres_are_those_of_central_differences() -> None:
    height = bumpy_map()
    surface = seen(place_height(height))
    inner = np.zeros_like(surface.mask)
    known = np.isfinite(height)
    inner[1:-1, 1:-1] = (
        known[1:-1, 1:-1] & known[:-2, 1:-1] & known[2:, 1:-1] & known[1:-1, :-2] & known[1:-1, 2:]
    )
    down, across = np.gradient(height)
    expected = np.stack([-across, down, np.ones_like(down)], -1)[inner]
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(surface.image(surface.normal)[inner], expected, atol=1e-5)


def test_a_plane_is_a_plane_up_to_its_rim() -> None:
    y, x = np.mgrid[:20, :30]
    field = place_height(0.5 * x - 0.25 * y + 3.0)
    mesh = field.mesh
    expected = np.array([-0.5, -0.25, 1.0]) / np.linalg.norm([0.5, 0.25, 1.0])
    np.testing.assert_allclose(
        mesh.normals, np.broadcast_to(expected, mesh.normals.shape), atol=1e-12
    )
    off = mesh.vertices @ expected
    np.testing.assert_allclose(off, off[0], atol=1e-12)


def test_the_object_is_two_units_long_and_its_faces_look_at_the_viewer() -> None:
    mesh = mesh_of_height(bumpy_map())
    assert np.ptp(mesh.vertices[:, :2], axis=0).max() == pytest.approx(2)
    assert mesh.uv.min() >= 0 and mesh.uv.max() <= 1
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.parametrize("kind", ["mat", "npy", "exr"])
def test_a_map_comes_back_from_a_file(kind: str, tmp_path: Path) -> None:
    height = bumpy_map()
    path = tmp_path / f"Z.{kind}"
    if kind == "mat":
        scipy.io.savemat(path, {"depth": height})
    elif kind == "npy":
        np.save(path, height)
    else:
        write_channels(
            path, {"height.Z": np.nan_to_num(height), "mask.A": np.isfinite(height).astype(float)}
        )
    np.testing.assert_allclose(read_height(path), height, rtol=1e-6)


@pytest.mark.parametrize(
    ("height", "words"),
    [
        (np.full((20, 20), np.nan), "0 pixels have a height"),
        (np.where(np.arange(400).reshape(20, 20) < 30, 1.0, np.inf), "30 pixels have a height"),
        (np.zeros((4, 400)), "400 x 4 pixels"),
        (np.zeros((8, 5000)), "5000 x 8 pixels"),
        (np.zeros((20, 20, 3)), "shape"),
        (np.zeros((20, 20), complex), "complex"),
        (np.arange(400.0).reshape(20, 20) * 10, "in pixels"),
    ],
)
def test_what_is_no_height_map_is_refused(height: np.ndarray, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        check_height(height)
    assert "\n" not in str(caught.value)


def test_bad_files_are_refused_by_name(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple:
            return (pytest.fail, ("a file's code was run",))

    np.save(tmp_path / "objects.npy", np.array([Trap()], dtype=object))
    np.savez(tmp_path / "several.npz", a=np.zeros(3))
    (tmp_path / "several.npz").rename(tmp_path / "several.npy")
    scipy.io.savemat(tmp_path / "other.mat", {"height": bumpy_map()})
    write_channels(tmp_path / "colour.exr", {"R": bumpy_map(), "G": bumpy_map()})
    np.save(tmp_path / "empty.npy", np.full((20, 20), np.nan))
    for name in ("junk.mat", "junk.npy", "junk.exr"):
        (tmp_path / name).write_bytes(b"nothing of the kind" * 20)
    expected = {
        "objects.npy": "not a readable array",
        "several.npy": "several arrays",
        "other.mat": "'depth'",
        "colour.exr": "name the one with the heights",
        "empty.npy": "0 pixels",
        "junk.mat": "not a readable MATLAB",
        "junk.npy": "not a readable array",
        "junk.exr": "OpenEXR",
        "absent.mat": "does not exist",
        "height.png": "are read from",
    }
    for name, words in expected.items():
        with pytest.raises(InputError, match=words) as caught:
            read_height(tmp_path / name)
        assert name in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.slow
def test_measured_objects_are_seen_as_they_were_measured(shared: Path) -> None:
    for name in ("apple", "teabag2"):
        height = read_height(shared / "data/mit_berkeley_train/laboratory" / name / "Z.mat")
        field = place_height(height)
        surface = seen(field)
        np.testing.assert_array_equal(surface.mask, np.isfinite(height))
        found = surface.position[:, 2] * field.pixels_per_unit + field.offset
        np.testing.assert_allclose(found, height[surface.mask], atol=1e-4)
