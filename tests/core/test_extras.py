"""The command that an error message gives for a missing optional dependency."""

import re
import shlex
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from isc_core.extras import install_command

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "optional-dependencies"
]


def test_the_command_names_the_packages() -> None:
    """`isc3d` is on no package index: its extras cannot be installed by their names."""
    for extra, requirements in EXTRAS.items():
        command = shlex.split(install_command(extra))
        assert command[:2] == ["pip", "install"]
        assert command[2:] == [entry.partition(";")[0].strip() for entry in requirements], extra


@pytest.mark.parametrize("listed", [None, [], ['click>=8; extra == "other"']])
def test_without_metadata_the_command_is_for_the_source(
    listed: list[str] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metadata, "requires", lambda name: listed)
    assert install_command("batch") == "pip install '.[batch]'"


def test_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> list[str]:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", missing)
    assert install_command("batch") == "pip install '.[batch]'"


def test_no_file_advises_to_install_isc3d_from_an_index() -> None:
    # A message, or a page that shows one.
    files = [
        path
        for folder in ("isc_core", "synth", "blender_addon", "training", "benchmarks", "docs")
        for suffix in ("py", "md", "j2", "html")
        for path in (ROOT / folder).rglob(f"*.{suffix}")
    ]
    assert [
        path.relative_to(ROOT).as_posix()
        for path in files
        if re.search(r"""pip install [`'"]*isc3d""", path.read_text(encoding="utf-8"))
    ] == []


def test_markers_of_a_requirement_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = [
        "numpy>=1.26",
        "numba>=0.59; python_version < '3.15'",
        """bpy>=4.5; (python_version == "3.11") and extra == 'blender'""",
        'dask[distributed]>=2024.8; extra == "batch"',
        'filelock; extra == "batch-more"',
    ]
    monkeypatch.setattr(metadata, "requires", lambda name: listed)
    assert install_command("blender") == "pip install 'bpy>=4.5'"
    assert install_command("batch") == "pip install 'dask[distributed]>=2024.8'"
