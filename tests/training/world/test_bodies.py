"""The sources of bodies on files made here: names, order, taking apart, screening, bad input."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError
from synth.scene.meshes import Mesh
from training.world.bodies import Body, BodyFolders, Source, body_names
from training.world.bodies.geometry.forms import ball, placed, rounded_box
from training.world.bodies.geometry.surface import Surface, together
from training.world.bodies.obj_file import read_obj
from training.world.bodies.screening import FEWEST, MOST, Fault, fault

PROPERTIES = """license=CC0
model#1=/things/cup/cup.obj
creator#1=A. Author
"""


def obj_text(objects: dict[str, Surface]) -> str:
    lines, start = [], 1
    for name, surface in objects.items():
        lines.append(f"o {name}")
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in surface.vertices]
        lines += [f"f {a}/1 {b}/2/3 {c}//4" for a, b, c in surface.faces + start]
        start += len(surface.vertices)
    return "\n".join(lines) + "\n"


def catalogue(folder: Path, objects: dict[str, Surface]) -> BodyFolders:
    with zipfile.ZipFile(folder / "Kitchen.sh3f", "w") as archive:
        archive.writestr("PluginFurnitureCatalog.properties", PROPERTIES)
        archive.writestr("things/cup/cup.obj", obj_text(objects))
    return BodyFolders(folder, None, None)


def a_box(x: float = 0.0, size: float = 0.3) -> Surface:
    return placed(rounded_box(np.array([1, 0.8, 0.5]), 0.2, 8), (x, 0, 0), size)


def assert_is_a_body(mesh: Mesh) -> None:
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    assert np.abs(low + high).max() < 1e-9
    assert (high - low).max() == pytest.approx(2)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    assert mesh.uv.shape == (len(mesh.vertices), 2)
    assert mesh.faces.max() < len(mesh.vertices)


def loaded(folders: BodyFolders) -> list[Body]:
    (reference,) = body_names(folders, 0, 0, 0)
    return reference.load()


def test_names_are_unique_and_ordered_by_the_seed() -> None:
    folders = BodyFolders(None, None, None)
    first, again, other = (body_names(folders, seed, 40, 20) for seed in (1, 1, 2))
    assert first == again != other
    assert {one.name for one in first} == {one.name for one in other}
    assert len({one.name for one in first}) == 60
    assert all(one.credit for one in first)
    assert sum(one.source is Source.FAMILY for one in first) == 20


def test_a_family_body_is_the_same_for_its_name() -> None:
    reference = body_names(BodyFolders(None, None, None), 0, 0, 1)[0]
    (first,), (second,) = reference.load(), reference.load()
    assert first.name == reference.name == "family/superquadric/0000"
    assert np.array_equal(first.mesh.vertices, second.mesh.vertices)
    assert_is_a_body(first.mesh)


def test_a_model_is_taken_apart(tmp_path: Path) -> None:
    ball_ = placed(ball(8), (2, 0, 0), 0.4)
    bodies = loaded(catalogue(tmp_path, {"box": a_box(), "ball": ball_}))
    assert [body.name for body in bodies] == [f"furniture/Kitchen/cup-{k}" for k in range(2)]
    for body, expected in zip(bodies, (ball_, a_box()), strict=True):
        assert len(body.mesh.faces) == len(expected.faces)
        assert_is_a_body(body.mesh)


def test_touching_parts_are_one_object_and_small_parts_are_objects_too(tmp_path: Path) -> None:
    plate = rounded_box(np.array([1, 0.1, 1]), 0.05, 12)
    vase = placed(ball(8), (0, 0.35, 0), 0.26)
    bodies = loaded(catalogue(tmp_path, {"plate": plate, "vase": vase}))
    assert [len(body.mesh.faces) for body in bodies] == [
        len(plate.faces) + len(vase.faces),
        len(vase.faces),
    ]


def test_equal_models_are_read_once_and_similar_ones_six_times(tmp_path: Path) -> None:
    chairs = {f"chair{k}": a_box(x=float(k)) for k in range(4)}
    assert len(loaded(catalogue(tmp_path, chairs))) == 1
    balls = {f"b{k}": placed(ball(8), (3 * k, 0, 0), (1, 1, 1 - 0.08 * k)) for k in range(9)}
    assert len(loaded(catalogue(tmp_path, balls))) == 6


def test_the_catalogue_gives_the_credit(tmp_path: Path) -> None:
    (reference,) = body_names(catalogue(tmp_path, {"box": a_box()}), 0, 0, 0)
    assert reference.credit == "A. Author; CC0"


def test_a_rigid_body_is_read(tmp_path: Path) -> None:
    (tmp_path / "007").mkdir()
    (tmp_path / "007" / "007.obj").write_text(obj_text({"convex_0": a_box()}))
    (body,) = loaded(BodyFolders(None, tmp_path, None))
    assert body.name == "urdf/0007" and body.source is Source.URDF
    assert_is_a_body(body.mesh)


def test_a_scan_is_read_with_its_credit(tmp_path: Path) -> None:
    surface = a_box()
    header = f"""ply
format ascii 1.0
element vertex {len(surface.vertices)}
property float x
property float y
property float z
element face {len(surface.faces)}
property list uchar int vertex_indices
end_header
"""
    rows = [" ".join(map(str, v)) for v in surface.vertices]
    rows += [f"3 {a} {b} {c}" for a, b, c in surface.faces]
    (tmp_path / "cat.ply").write_text(header + "\n".join(rows) + "\n")
    (tmp_path / "README.md").write_text("| cat.ply | 1 | CC BY, A. Author |\n")
    folders = BodyFolders(None, None, tmp_path)
    (body,) = loaded(folders)
    assert body.name == "scan/cat" and len(body.mesh.faces) == len(surface.faces)
    assert body_names(folders, 0, 0, 0)[0].credit == "CC BY, A. Author"


def test_obj_polygons_become_fans_and_negative_numbers_count_back() -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\no a\nf -4 -3 -2 -1\ng b\nf 1 2 3\n"
    surface, objects = read_obj(text, "square")
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]
    assert objects.tolist() == [1, 1, 2]


@pytest.mark.parametrize("text", ["v 0 0 zero\n", "v 0 0 0\nf 1 2 3\n", "f a b c\n", ""])
def test_a_damaged_or_empty_body_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "1").mkdir()
    (tmp_path / "1" / "1.obj").write_text(text)
    with pytest.raises(InputError) as caught:
        loaded(BodyFolders(None, tmp_path, None))
    assert "\n" not in str(caught.value) and "1.obj" in str(caught.value)


@pytest.mark.parametrize("source", ["furniture", "urdfs", "scans"])
def test_an_empty_folder_is_one_line(tmp_path: Path, source: str) -> None:
    folders = dict.fromkeys(("furniture", "urdfs", "scans"))
    with pytest.raises(InputError, match="name the folder"):
        body_names(BodyFolders(**{**folders, source: tmp_path}), 0, 0, 0)


def test_a_file_that_is_no_archive_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.sh3f").write_bytes(b"not a zip file")
    with pytest.raises(InputError, match="not a readable zip"):
        body_names(BodyFolders(tmp_path, None, None), 0, 0, 0)


def soup(count: int) -> Surface:
    """Triangles of equal size at random."""
    rng = np.random.default_rng(0)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + 0.05 * rng.normal(size=(count, 3, 3))
    return Surface(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def with_a_hole_in_the_numbers() -> Surface:
    surface = a_box()
    vertices = surface.vertices.copy()
    vertices[0] = np.nan
    return Surface(vertices, surface.faces)


def inside_a_shell() -> Surface:
    """Nested balls: most of the surface is hidden."""
    return together([placed(ball(6), scale=1 if k == 0 else 0.7 - 0.02 * k) for k in range(10)])


@pytest.mark.parametrize(
    ("surface", "expected"),
    [
        (a_box(), None),
        (ball(8), None),
        (ball(8).part(np.arange(FEWEST - 1)), Fault.DEGENERATE),
        (Surface(np.zeros((3, 3)), np.zeros((FEWEST, 3), int)), Fault.DEGENERATE),
        (with_a_hole_in_the_numbers(), Fault.DEGENERATE),
        (Surface(np.zeros((3, 3)), np.zeros((MOST + 1, 3), int)), Fault.HUGE),
        (placed(ball(8), scale=(1, 1, 0.015)), Fault.FLAT),
        (soup(400), Fault.SCRAPS),
        (inside_a_shell(), Fault.INSIDE),
    ],
)
def test_rules_of_screening(surface: Surface, expected: Fault | None) -> None:
    assert fault(surface) is expected


def test_a_tilted_plate_is_flat_too() -> None:
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    assert fault(placed(ball(8), scale=(1, 0.7, 0.015))) is Fault.FLAT
    assert fault(placed(placed(ball(8), scale=(1, 0.7, 0.015)), turn=turn)) is Fault.FLAT
