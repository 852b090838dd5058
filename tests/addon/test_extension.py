"""The zips: contents, rewritten imports, reproducible bytes, and Blender's validation."""

import ast
import importlib.util
import tomllib
import zipfile
from pathlib import Path

import pytest

from blender_addon.packaging.__main__ import build, main
from blender_addon.packaging.archive import contents, manifest, write_archive
from blender_addon.packaging.kernels.build import MACHINES
from blender_addon.packaging.rewrite import installed_source
from blender_addon.packaging.targets import TARGETS, Target, chosen
from blender_addon.packaging.validate import validate
from blender_addon.packaging.wheels import locked, wheels_for
from isc_core.errors import InputError

LINUX = Target("linux-x64", (3, 11), "4.5.0", "5.1.0")
needs_bpy = pytest.mark.skipif(
    importlib.util.find_spec("bpy") is None,
    reason="needs the extra `blender` (Python 3.11 or 3.13)",
)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_each_target_has_one_wheel_of_each_package_and_never_numpy(target: Target) -> None:
    packages = [name.split("-")[0] for name in locked() if target.runs(name)]
    assert sorted(packages) == ["openexr", "pillow", "scipy", "trimesh"]
    assert target.platform in MACHINES  # no compiler is shipped


def test_every_locked_wheel_is_used_and_has_the_version_the_project_is_tested_with() -> None:
    root = Path(__file__).resolve().parents[2]
    pins = {
        line.split(";")[0].strip().lower().replace("-", "_")
        for line in (root / "constraints.txt").read_text().splitlines()
    }
    for name in locked():
        assert any(target.runs(name) for target in TARGETS), f"{name} is for nobody"
        assert "{}=={}".format(*name.lower().split("-")[:2]) in pins, (
            f"{name} is not what constraints.txt pins"
        )


@pytest.mark.parametrize(
    ("wheel", "runs"),
    [
        ("a-1-cp311-cp311-manylinux_2_28_x86_64.whl", True),
        ("a-1-cp37-abi3-manylinux_2_17_x86_64.manylinux2014_x86_64.whl", True),
        ("a-1-py3-none-any.whl", True),
        ("a-1-cp313-cp313-manylinux_2_28_x86_64.whl", False),
        ("a-1-cp313-abi3-manylinux_2_28_x86_64.whl", False),
        ("a-1-cp311-cp311-manylinux_2_28_aarch64.whl", False),
        ("a-1-cp311-cp311-win_amd64.whl", False),
        ("a-1-cp311-cp311t-manylinux_2_28_x86_64.whl", False),
    ],
)
def test_a_wheel_is_chosen_by_its_tags(wheel: str, runs: bool) -> None:
    assert LINUX.runs(wheel) is runs


def test_targets_are_chosen_by_name() -> None:
    assert chosen("all") == TARGETS
    assert [target.name for target in chosen("windows-x64-cp313")] == ["windows-x64-cp313"]
    with pytest.raises(
        InputError, match="no extension is built for amiga-cp311: choose all, here, linux-x64-cp311"
    ):
        chosen("amiga-cp311")


@pytest.mark.parametrize(
    ("name", "source", "shipped"),
    [
        (
            "worker.py",
            "from isc_core.errors import InputError\n",
            "from .isc_core.errors import InputError\n",
        ),
        (
            "a/b.py",
            "def f():\n    from isc_core.errors import (\n        A,\n    )\n",
            "def f():\n    from ..isc_core.errors import (\n        A,\n    )\n",
        ),
        (
            "worker.py",
            'RUN = "from isc_core.errors import A"\n',
            'RUN = "from isc_core.errors import A"\n',
        ),
        (
            "a.py",
            "from . import b\nimport bpy, json\nimport numpy as np\n",
            "from . import b\nimport bpy, json\nimport numpy as np\n",
        ),
    ],
)
def test_imports_of_the_core_become_relative_and_nothing_else_changes(
    name: str, source: str, shipped: str
) -> None:
    assert installed_source(source, name) == shipped


@pytest.mark.parametrize(
    "source",
    [
        "import isc_core\n",
        "import isc_core.errors as e\n",
        "from isc_core import errors\n",
        "from isc_core.photo import read_photo\n",  # not for Blender's own process
        "from blender_addon.worker.process import start\n",
        "import scipy.ndimage\n",
        "def f():\n    import PIL\n",
    ],
)
def test_an_import_that_would_fail_once_installed_stops_the_build(source: str) -> None:
    with pytest.raises(InputError, match="a.py:"):
        installed_source(source, "a.py")


def test_the_zip_contains_the_addon_and_the_core_but_no_tools() -> None:
    names = set(contents(LINUX, []))
    assert {
        "blender_manifest.toml",
        "LICENSE",
        "__init__.py",
        "headless.py",
        "isc_core/__main__.py",
        "isc_core/sirfs/priors/data/priors.npz",
    } <= names
    assert not [
        name
        for name in names
        if name.startswith(("packaging/", "wheels/", "tests/", "blender_addon/"))
        or "__pycache__" in name
    ]


@pytest.mark.slow
def test_every_module_in_the_zip_is_python_that_names_no_package_of_the_source_tree() -> None:
    for name, content in contents(LINUX, []).items():
        if not name.endswith(".py"):
            continue
        tree = ast.parse(content if isinstance(content, bytes) else content.read_bytes(), name)
        modules = [
            node.module or ""
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.level == 0
        ]
        modules += [
            alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.Import)
            for alias in node.names
        ]
        assert not [
            module
            for module in modules
            if module.split(".")[0] in {"isc_core", "blender_addon", "synth"}
        ], name


def test_the_manifest_describes_the_target() -> None:
    about = tomllib.loads(
        manifest(LINUX, [Path("x/scipy-1-cp311-cp311-manylinux_2_28_x86_64.whl")])
    )
    assert (about["id"], about["blender_version_min"], about["blender_version_max"]) == (
        "isc_intrinsic",
        "4.5.0",
        "5.1.0",
    )
    assert about["platforms"] == ["linux-x64"]
    assert about["wheels"] == ["./wheels/scipy-1-cp311-cp311-manylinux_2_28_x86_64.whl"]
    assert list(about["permissions"]) == ["files"]
    assert about["license"] == ["SPDX:GPL-3.0-or-later"]
    assert "blender_version_max" not in tomllib.loads(manifest(TARGETS[-1], []))


def test_the_same_files_make_the_same_bytes(tmp_path: Path) -> None:
    entries = contents(LINUX, [])
    write_archive(tmp_path / "a.zip", entries)
    write_archive(tmp_path / "b.zip", dict(reversed(entries.items())))
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        assert archive.testzip() is None
        assert archive.namelist() == sorted(entries)


def test_a_wheel_that_is_not_the_locked_one_stops_the_build(tmp_path: Path) -> None:
    folder = tmp_path / LINUX.name
    folder.mkdir()
    with pytest.raises(InputError, match="lacks .*scipy.*: build once without --offline"):
        wheels_for(LINUX, tmp_path, offline=True)
    for name in locked():
        if LINUX.runs(name):
            (folder / name).write_bytes(b"something else")
    with pytest.raises(
        InputError, match="does not have the hash in wheels.sha256: delete it and build again"
    ):
        wheels_for(LINUX, tmp_path, offline=True)


@pytest.mark.slow
@needs_bpy
def test_blender_validates_the_zip_and_a_rejection_is_reported(tmp_path: Path) -> None:
    path = build(LINUX, tmp_path, None)
    assert validate(path)
    entries = contents(LINUX, [])
    text = bytes(entries["blender_manifest.toml"]).decode()  # type: ignore[arg-type]
    write_archive(
        tmp_path / "bad.zip",
        entries | {"blender_manifest.toml": text.replace('"Material"', '"Magic"').encode()},
    )
    with pytest.raises(InputError, match="Blender rejects bad.zip: .*Magic"):
        validate(tmp_path / "bad.zip")


def test_the_command_prints_errors_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(
            [
                "linux-x64-cp311",
                "--offline",
                "-o",
                str(tmp_path),
                "--wheels",
                str(tmp_path / "none"),
            ]
        )
        == 2
    )
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.glob("*.zip"))
