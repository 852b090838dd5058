"""Regression tests for fuzzing findings: small files that must be refused in one quiet line."""

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from isc_core.cli.main import main
from isc_core.datasets.mit_berkeley import load_natural_lights
from isc_core.errors import InputError
from isc_core.io.exr import read_channels
from isc_core.io.json_files import read_json
from isc_core.io.limits import Limits
from isc_core.io.matlab import read_matrix
from isc_core.io.npy import read_array, read_arrays
from isc_core.networks.scene_network import SceneNetwork
from isc_core.photo import WholeFrame, read_linear, read_photo
from isc_core.result_files.known_inputs import read_light
from isc_core.result_files.result_folder import load
from isc_core.separation.support.filter_statistics import read_table, shipped_table
from synth.dataset.reading import read_facts
from synth.shapes.mesh_file import read_mesh_file
from synth.validation.measurement.bounds import read_bounds
from synth.validation.reporting.folder import FILES, report_files
from tests.fuzz.data_files import deflated, matlab, result_files, scene_files
from tests.fuzz.mesh_files import glb
from tests.fuzz.pictures import array, ball, coded, codes, exr


@pytest.fixture
def refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Callable[..., None]:
    """Give a reader a file; it must raise `InputError` with `words` and print nothing."""

    def check(
        read: Callable[[Path], object], name: str, data: bytes, words: str, **beside: bytes
    ) -> None:
        for other, content in beside.items():
            (tmp_path / other.replace("_", ".")).write_bytes(content)
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=words) as caught:
            read(tmp_path / name)
        assert str(caught.value).isprintable()
        assert capfd.readouterr() == ("", "")

    return check


def archive(kind: int = zipfile.ZIP_DEFLATED, **members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", kind) as written:
        for name, content in members.items():
            written.writestr(f"{name}.npy", content)
    return stream.getvalue()


def header(text: str, version: int = 1) -> bytes:
    """The start of a `.npy` file with any text in its header."""
    coded_text = text.encode("latin-1")
    return (
        b"\x93NUMPY"
        + bytes([version, 0])
        + struct.pack("<H" if version == 1 else "<I", len(coded_text))
        + coded_text
    )


# --- pictures -------------------------------------------------------------------------------------

PLANES = {name: ball()[..., k].astype(np.float32) for k, name in enumerate("RGB")}


@pytest.mark.parametrize("read", [read_channels, read_photo])
def test_damaged_pixels_of_an_exr_are_refused_quietly(
    refused: Callable[..., None], read: Callable[[Path], object]
) -> None:
    data = bytearray(exr(PLANES))
    data[-300:-200] = bytes(100)
    refused(read, "a.exr", bytes(data), "readable|damaged")


def with_window(left: int, top: int, right: int, bottom: int) -> bytes:
    data = exr(PLANES)
    at = data.index(b"dataWindow\0box2i\0") + 21
    return data[:at] + struct.pack("<4i", left, top, right, bottom) + data[at + 16 :]


@pytest.mark.parametrize(
    ("window", "words"),
    [
        ((0, 0, 2**31 - 1, 2**31 - 1), "megapixels"),
        ((-(2**31), -(2**31), 2**31 - 1, 2**31 - 1), "megapixels"),
        ((0, 0, 9_999, 9_999), "readable|damaged"),
        ((5, 5, 4, 4), "readable|damaged"),
    ],
)
def test_exr_windows_that_claim_too_much_are_refused(
    refused: Callable[..., None], window: tuple[int, int, int, int], words: str
) -> None:
    for read in (read_channels, read_photo):
        refused(read, "a.exr", with_window(*window), words)


def test_deep_exr_and_strange_channels_are_refused(refused: Callable[..., None]) -> None:
    data = exr(PLANES)
    refused(read_channels, "a.exr", data[:5] + bytes([data[5] | 8]) + data[6:], "deep")
    at = data.index(b"channels\0chlist\0") + 20
    sampling = at + 2 + 8
    refused(
        read_channels,
        "a.exr",
        data[:sampling] + struct.pack("<ii", 0, 0) + data[sampling + 8 :],
        "subsampled",
    )
    refused(
        read_channels, "a.exr", data[: at + 2] + struct.pack("<i", 7) + data[at + 6 :], "readable"
    )


def test_pixel_limit_applies_before_decoding(refused: Callable[..., None], tmp_path: Path) -> None:
    few = Limits(max_pixels=400)
    for suffix, pixels in (
        (".png", codes(16)),
        (".png", codes()),
        (".jpg", codes()),
        (".tiff", codes(16)),
        (".hdr", ball().astype(np.float32)),
    ):
        refused(
            lambda path: read_photo(path, whole_frame=WholeFrame.WITHOUT_MASK, limits=few),
            f"a{suffix}",
            coded(suffix, pixels),
            "20 x 24 pixels.*--max-pixels",
        )
    for name, data in (("a.exr", exr(PLANES)), ("a.npy", array(codes()))):
        refused(
            lambda path: read_linear(path, limits=few), name, data, "20 x 24 pixels.*--max-pixels"
        )
    (tmp_path / "photo.png").write_bytes(coded(".png", codes()))
    assert read_photo(tmp_path / "photo.png", limits=Limits(max_pixels=480)).mask.any()


# --- numbers --------------------------------------------------------------------------------------

HEADERS = {
    "unfinished": "{'descr': '<f4', 'fortran_order': False, 'shape': (",
    "nested": "(" * 5000,
    "kind that is none": "{'descr': '<q9', 'fortran_order': False, 'shape': (2,)}",
    "objects": "{'descr': '|O', 'fortran_order': False, 'shape': (2,)}",
    "records": "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (2,)}",
    "negative": "{'descr': '<f4', 'fortran_order': False, 'shape': (-2, -2)}",
    "huge": "{'descr': '<f4', 'fortran_order': False, 'shape': (999999999, 999999999)}",
    "no size": "{'descr': '|V0', 'fortran_order': False, 'shape': (999999999,)}",
}


@pytest.mark.parametrize("case", HEADERS)
@pytest.mark.parametrize("version", [1, 2])
def test_damaged_array_headers_are_refused(
    refused: Callable[..., None], case: str, version: int
) -> None:
    data = header(HEADERS[case], version) + bytes(64)
    refused(read_array, "a.npy", data, "not a readable array")
    refused(read_photo, "a.npy", data, "damaged|values of type|an array of shape|objects|pixels")
    refused(read_arrays, "a.npz", archive(a=data), "not a readable array")


def test_archives_that_unpack_to_much_are_refused(refused: Callable[..., None]) -> None:
    few = Limits(max_bytes=1 << 20)
    bomb = archive(a=array(np.zeros(1 << 20)))
    assert len(bomb) < 1 << 14
    refused(lambda path: read_arrays(path, few), "a.npz", bomb, "unpacks to")
    refused(read_arrays, "a.npz", archive(zipfile.ZIP_LZMA, a=array(np.zeros(9))), "not an archive")
    refused(
        lambda path: read_matrix(path, "depth", limits=few),
        "a.mat",
        deflated(matlab({"depth": np.zeros((400, 900))}, packed=False)),
        "unpacks",
    )


@pytest.mark.parametrize("kind", [0, 8, 10, 14, 15, 19, 255])
def test_matrix_of_an_unknown_type_is_refused(refused: Callable[..., None], kind: int) -> None:
    """SciPy crashes on it."""
    data = bytearray(matlab({"depth": np.arange(9.0).reshape(3, 3)}, packed=False))
    values = data.index(struct.pack("<II", 9, 72))
    data[values : values + 4] = struct.pack("<I", kind)
    for wrapped in (bytes(data), deflated(bytes(data))):
        refused(lambda path: read_matrix(path, "depth"), "a.mat", wrapped, "not a readable MATLAB")


def test_matrix_that_claims_more_than_it_holds(refused: Callable[..., None]) -> None:
    data = bytearray(matlab({"depth": np.zeros((3, 3))}, packed=False))
    shape = data.index(struct.pack("<ii", 3, 3))
    data[shape : shape + 8] = struct.pack("<ii", 2**31 - 1, 2**31 - 1)
    for wrapped in (bytes(data), deflated(bytes(data))):
        refused(
            lambda path: read_matrix(path, "depth"), "a.mat", wrapped, "not a readable MATLAB file"
        )
    deep: object = np.zeros(2)
    for _ in range(30):
        deep = {"depth": deep}
    refused(
        lambda path: read_matrix(path, "depth", "depth"),
        "a.mat",
        matlab({"depth": deep}, packed=True),
        "readable|lacks",
    )
    refused(
        lambda path: read_matrix(path, "depth"),
        "a.mat",
        matlab({"depth": "text"}, packed=True),
        "not a readable MATLAB file",
    )


def test_matrices_are_read_as_they_were_written(tmp_path: Path) -> None:
    values = {
        "depth": np.arange(6.0).reshape(2, 3),
        "s": {"a": np.arange(4, dtype=np.int16).reshape(2, 2), "b": "x", "c": {"d": 7.5}},
    }
    for packed in (False, True):
        (tmp_path / "a.mat").write_bytes(matlab(values, packed=packed))
        np.testing.assert_array_equal(read_matrix(tmp_path / "a.mat", "depth"), values["depth"])
        np.testing.assert_array_equal(read_matrix(tmp_path / "a.mat", "s", "a"), [[0, 1], [2, 3]])
        assert read_matrix(tmp_path / "a.mat", "s", "c", "d").item() == 7.5
    (tmp_path / "natural_lights.mat").write_bytes(matlab({"Ls": np.ones((9, 3, 2))}, packed=True))
    assert load_natural_lights(tmp_path).shape == (9, 3, 2)


def test_tables_and_networks_with_nan_are_refused(refused: Callable[..., None]) -> None:
    table = shipped_table()
    members = {
        "spread": table.spread,
        "without": table.without,
        "highlight": table.highlight,
        "temperature": np.array(table.temperature),
    }
    broken = np.array(table.spread, np.float64)
    broken[0] = np.nan
    refused(
        read_table,
        "a.npz",
        archive(**{key: array(np.asarray(v)) for key, v in (members | {"spread": broken}).items()}),
        "a.npz",
    )
    weights = {"weight00": np.full((3, 3), np.nan, np.float32), "bias00": np.zeros(3, np.float32)}
    refused(
        SceneNetwork.read,
        "a.npz",
        archive(**{key: array(value) for key, value in weights.items()}),
        "not finite",
    )


# --- descriptions ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", ["[" * 100_000, "{" * 100_000, '{"a":' * 100_000, "\ufeff{", "1" * 10_000, "", "\0"]
)
def test_damaged_json_is_refused(refused: Callable[..., None], text: str) -> None:
    refused(read_json, "a.json", text.encode(), "a.json")
    refused(read_light, "a.json", text.encode(), "a.json")
    refused(lambda path: read_facts(path.parent), "scene.json", text.encode(), "scene.json")


def test_numbers_too_large_for_floats_are_refused(refused: Callable[..., None]) -> None:
    refused(read_light, "a.json", json.dumps([[10**400] * 3] * 9).encode(), "is not a light")


@pytest.mark.parametrize("name", ["line\nend", "\x1b[2J", "\u202egnp.exe", "\udce9"])
def test_messages_are_printable(name: str) -> None:
    assert str(InputError(f"channel {name}: not known")).isprintable()
    assert str(InputError("Größe 5 °: “x”")) == "Größe 5 °: “x”"


# --- meshes ---------------------------------------------------------------------------------------

CUBE = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 {z}\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5
f 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8\n"""
PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 1\nend_header\n"
)


def test_meshes_that_trip_the_loader_are_refused(refused: Callable[..., None]) -> None:
    refused(read_mesh_file, "a.ply", PLY, "a.ply")
    refused(
        read_mesh_file, "a.ply", PLY.replace(b"face 1", b"face 1\nproperty list uchar"), "a.ply"
    )
    refused(read_mesh_file, "a.obj", CUBE.format(z="1e160").encode(), "a.obj")
    refused(read_mesh_file, "a.obj", CUBE.format(z="1e30").encode(), "deeper than wide")
    refused(
        read_mesh_file,
        "a.stl",
        b"solid a\nfacet normal 0 0 1\nouter loop\nvertex a b c\nendloop\nendfacet\nendsolid\n",
        "a.stl",
    )
    accessor = {"componentType": 5126, "count": 1, "type": "VEC3"}
    strange = {
        "asset": {"version": "2.0"},
        "accessors": [accessor | {"bufferView": 5}],
        "bufferViews": [],
        "meshes": [],
    }
    refused(read_mesh_file, "a.glb", glb(json.dumps(strange).encode(), b""), "a.glb")
    for count in (2**31, -1, "many", 1e999):
        claims = {"asset": {"version": "2.0"}, "accessors": [accessor | {"count": count}]}
        refused(
            read_mesh_file,
            "a.glb",
            glb(json.dumps(claims).encode(), b""),
            "declares more than|readable",
        )


def test_unused_vertices_do_not_matter(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.obj").write_text(
        CUBE.format(z=1).replace("f", "v 1e300 -1e308 nan\nf", 1), encoding="utf-8"
    )
    assert np.abs(read_mesh_file(tmp_path / "a.obj").mesh.vertices).max() <= 1
    assert capfd.readouterr() == ("", "")


def huge_number(text: bytes, key: bytes) -> bytes:
    """A description whose first number behind `key` has 400 digits."""
    return re.sub(rb'("' + key + rb'"[^0-9]*)[0-9.]+', rb"\g<1>" + b"9" * 400, text, count=1)


@pytest.mark.slow
def test_whole_numbers_of_any_length_are_refused(refused: Callable[..., None]) -> None:
    result, scene = result_files(), scene_files()["scene.json"]
    beside = {
        name.replace(".", "_"): data
        for name, data in result.items()
        if name != "decomposition.json"
    }
    for key in (b"coefficients", b"scale", b"alpha", b"cone_68_degrees"):
        damaged = huge_number(result["decomposition.json"], key)
        refused(lambda path: load(path.parent), "decomposition.json", damaged, "damaged", **beside)
    refused(
        lambda path: read_facts(path.parent),
        "scene.json",
        huge_number(scene, b"specular_share"),
        "specular_share",
    )
    limit = {"stage": "a", "metric": "b", "kind": "c", "value": "d", "limit": 1}
    bounds = json.dumps({"schema_version": 1, "bounds": [limit]}).encode()
    refused(read_bounds, "bounds.json", huge_number(bounds, b"limit"), "must be a number")


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [
        {"scale": 0},
        {"scale": "1"},
        {"size": [0, 1]},
        {"size": "ab"},
        {"bit_depth": None},
        {"name": 3},
    ],
)
def test_input_record_of_a_result_is_checked(
    refused: Callable[..., None], given: dict[str, object]
) -> None:
    result = dict(result_files())
    described = json.loads(result.pop("decomposition.json"))
    described["input"] |= given
    beside = {name.replace(".", "_"): data for name, data in result.items()}
    refused(
        lambda path: load(path.parent),
        "decomposition.json",
        json.dumps(described).encode(),
        f"no usable input.{next(iter(given))}",
        **beside,
    )


TEXTURED = (
    b"mtllib a.mtl\nusemtl a\n" + CUBE.format(z=1).replace("f ", "vt 0.1 0.2\nf ", 1).encode()
)


def test_hostile_textures_are_refused(refused: Callable[..., None]) -> None:
    material = b"newmtl a\nmap_Kd a.png\n"
    size = struct.pack(">II", 60_000, 60_000)
    picture = coded(".png", codes())
    start = picture[:16] + size + picture[24:29]
    bomb = start + struct.pack(">I", zlib.crc32(start[12:])) + picture[33:]
    program = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n(x) print quit\n"
    for data in (bomb, program, picture[:70] + bytes(9) + picture[79:]):
        refused(read_mesh_file, "a.obj", TEXTURED, "a.obj|a.png", a_mtl=material, a_png=data)
    for outside in (b"../secret.png", b"/etc/hostname", b"..\\secret.png"):
        refused(
            read_mesh_file,
            "a.obj",
            TEXTURED,
            "not in its folder",
            a_mtl=b"newmtl a\nmap_Kd " + outside + b"\n",
        )


@pytest.mark.parametrize("uv", ["nan nan", "1e300 -1e300", "inf 0"])
def test_non_finite_texture_coordinates_are_quiet(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], uv: str
) -> None:
    text = CUBE.format(z=1)
    faces = "\n".join(
        "f " + " ".join(f"{k}/1" for k in line[2:].split())
        for line in text.splitlines()
        if line.startswith("f")
    )
    vertices = "\n".join(line for line in text.splitlines() if line.startswith("v"))
    (tmp_path / "a.obj").write_text(
        f"mtllib a.mtl\nusemtl a\n{vertices}\nvt {uv}\n{faces}\n", encoding="utf-8"
    )
    (tmp_path / "a.mtl").write_bytes(b"newmtl a\nmap_Kd a.png\n")
    (tmp_path / "a.png").write_bytes(coded(".png", codes()))
    found = read_mesh_file(tmp_path / "a.obj", texture_size=16)
    assert found.albedo is not None and np.isfinite(found.albedo).all()
    assert capfd.readouterr() == ("", "")


# --- paths and pages ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "evidence/../mine.exr",
        "evidence/a/../../../x.exr",
        "/etc/x.exr",
        "evidence/.hidden/x.exr",
        "evidence\\a\\x.exr",
    ],
)
def test_earlier_report_names_only_its_evidence(tmp_path: Path, name: str) -> None:
    report = {"evidence": ["evidence/scene3/diffuse.exr", name]}
    (tmp_path / "report.json").write_text(json.dumps(report), encoding="utf-8")
    assert report_files(tmp_path) == (*FILES, "evidence/scene3/diffuse.exr")


def test_a_mesh_opens_nothing_through_a_link_out_of_its_folder(tmp_path: Path) -> None:
    (tmp_path / "secret.png").write_bytes(coded(".png", codes()))
    folder = tmp_path / "mesh"
    folder.mkdir()
    (folder / "a.png").symlink_to(tmp_path / "secret.png")
    (folder / "a.mtl").write_bytes(b"newmtl a\nmap_Kd a.png\n")
    (folder / "a.obj").write_bytes(TEXTURED)
    with pytest.raises(InputError, match="not in its folder"):
        read_mesh_file(folder / "a.obj")


@pytest.mark.parametrize(
    "words", ["decompose {} -o {}", "separate {} -o {}", "mask {} --box 2,2,14,14 -o {}.png"]
)
def test_commands_apply_the_pixel_limit(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], words: str
) -> None:
    (tmp_path / "a.png").write_bytes(coded(".png", codes()))
    command = words.format(tmp_path / "a.png", tmp_path / "out").split()
    assert main([*command, "--max-pixels", "479"]) == 2
    assert "20 x 24 pixels" in capfd.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    assert main([*command, "--max-pixels", "0"]) == 2
    assert "not a whole number, 1 or more" in capfd.readouterr().err
