"""Build backend (PEP 517): setuptools, with collision-free package names in the wheel.

Problem: `synth` and `benchmarks` are good names for folders of a repository, but as top-level
packages in site-packages they may collide with another distribution. setuptools can install a
folder under another name, but does not change the imports.

A wheel is therefore built from a copy of the tree in which folders, absolute imports and entry
points have the names of `PACKAGES`. Editable installations and sdists keep the names of the
repository.

Limits: modules of a renamed package are imported by `from PACKAGE import ...`, at the start of a
line or an indented line; other imports abort the build. A name inside a string is found after `-m`
only.
"""

import ast
import os
import re
import shutil
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from setuptools import build_meta
from setuptools.build_meta import (
    build_editable,
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

# The packages of the wheel: folder in the repository, name once installed.
PACKAGES = {
    "isc_core": "isc_core",
    "synth": "isc_synth",
    "benchmarks": "isc_benchmarks",
    "blender_addon": "isc_blender_addon",
}
# Only usable in a repository. The other benchmarks are needed by `isc thesis`.
LEFT_OUT = (
    "benchmarks/batch",
    "benchmarks/blender",
    "benchmarks/decomposition",
    "benchmarks/detail",
    "benchmarks/refinement/closed_loop.py",
    "benchmarks/mesh",
    "benchmarks/records.py",
    "benchmarks/separation/clipped_fill.py",
    "benchmarks/separation/print_rule.py",
    "benchmarks/separation/print_set.py",
    "benchmarks/separation/prints.py",
    "benchmarks/sirfs",
    "benchmarks/tabletops",
    "blender_addon/packaging",
)
_RENAMED = {folder: name for folder, name in PACKAGES.items() if folder != name}
_PROGRAM = re.compile(rf"(?<=-m )({'|'.join(_RENAMED)})(?=\.)".encode())
_Settings = Mapping[str, str | list[str] | None] | None


def build_wheel(
    wheel_directory: str,
    config_settings: _Settings = None,
    metadata_directory: str | None = None,
) -> str:
    """Build the wheel; see PEP 517.

    Parameters
    ----------
    wheel_directory : str
        Folder for the wheel.
    config_settings : mapping, optional
        Settings of the caller, for setuptools.
    metadata_directory : str, optional
        Result of `prepare_metadata_for_build_wheel`.

    Returns
    -------
    str
        File name of the wheel.
    """
    folder = os.path.abspath(wheel_directory)
    metadata = metadata_directory and os.path.abspath(metadata_directory)
    with _staged():
        return build_meta.build_wheel(folder, config_settings, metadata)


def prepare_metadata_for_build_wheel(
    metadata_directory: str, config_settings: _Settings = None
) -> str:
    """Write the metadata of the wheel; see PEP 517.

    Parameters
    ----------
    metadata_directory : str
        Folder for the metadata.
    config_settings : mapping, optional
        Settings of the caller, for setuptools.

    Returns
    -------
    str
        Name of the folder that was created.
    """
    folder = os.path.abspath(metadata_directory)
    with _staged():
        return build_meta.prepare_metadata_for_build_wheel(folder, config_settings)


@contextmanager
def _staged() -> Iterator[None]:
    """Work in a copy of the tree with the names of the wheel."""
    source = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="isc3d-") as copy:
        stage(source, Path(copy))
        os.chdir(copy)
        try:
            yield
        finally:
            os.chdir(source)


def stage(source: Path, target: Path) -> None:
    """Copy the sources of a wheel, with the names of the wheel.

    Parameters
    ----------
    source : Path
        The repository, or an unpacked sdist.
    target : Path
        An existing folder.

    Raises
    ------
    ValueError
        If an import cannot be rewritten.
    """
    for name in ("README.md", "LICENSE"):
        shutil.copy2(source / name, target)
    project = (source / "pyproject.toml").read_text(encoding="utf-8")
    (target / "pyproject.toml").write_text(renamed_project(project), encoding="utf-8")
    for path in shipped_files(source):
        folder, *parts = path.relative_to(source).parts
        copy = target.joinpath(PACKAGES[folder], *parts)
        copy.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".py":
            copy.write_bytes(renamed_source(path.read_bytes(), str(path)))
        else:
            shutil.copy2(path, copy)


def shipped_files(source: Path) -> Iterator[Path]:
    """Iterate over the files of the packages that belong in the wheel.

    Parameters
    ----------
    source : Path
        The repository, or an unpacked sdist.

    Yields
    ------
    Path
    """
    left_out = [source / name for name in LEFT_OUT]
    for folder in PACKAGES:
        for path in sorted((source / folder).rglob("*")):
            unused = path.suffix == ".pyc" or any(path.is_relative_to(one) for one in left_out)
            if path.is_file() and not unused:
                yield path


def renamed_project(text: str) -> str:
    """Return pyproject.toml with the names of the wheel in its entry points.

    Entry points of excluded packages are removed.

    Parameters
    ----------
    text : str
        Content of the file in the repository.

    Returns
    -------
    str
    """
    for group in tomllib.loads(text)["project"]["entry-points"].values():
        for command, reference in group.items():
            folder, dot, rest = re.match(r"(\w+)([.:])(.*)", reference).groups()
            if folder not in PACKAGES:
                text = text.replace(f'{command} = "{reference}"\n', "")
            name = _RENAMED.get(folder, folder)
            text = text.replace(f'"{reference}"', f'"{name}{dot}{rest}"')
    return text


def renamed_source(source: bytes, name: str) -> bytes:
    """Return the text of a module with the names of the wheel in its imports.

    Parameters
    ----------
    source : bytes
        The text, in UTF-8.
    name : str
        File name, for errors.

    Returns
    -------
    bytes

    Raises
    ------
    ValueError
        If an import cannot be rewritten.
    """
    lines = source.splitlines(keepends=True)
    for node in ast.walk(ast.parse(source, name)):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules = [node.module or ""]
        else:
            continue
        for folder in _RENAMED.keys() & {module.partition(".")[0] for module in modules}:
            index, start = node.lineno - 1, node.col_offset
            old, new = (f"from {one}".encode() for one in (folder, _RENAMED[folder]))
            if not lines[index][start:].startswith(old):
                raise ValueError(
                    f"{name}:{node.lineno}: cannot rename {folder}: write `from {folder} import`"
                )
            lines[index] = lines[index][:start] + new + lines[index][start + len(old) :]
    return _PROGRAM.sub(lambda found: _RENAMED[found[0].decode()].encode(), b"".join(lines))
