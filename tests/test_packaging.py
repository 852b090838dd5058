"""The wheel and the sdist: names, contents, metadata; and, installed in an empty environment, the
command and the five lines of the README.
"""

import ast
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from configparser import ConfigParser
from dataclasses import dataclass
from email import message_from_bytes
from email.message import Message
from pathlib import Path
from types import ModuleType

import pytest

from isc_core import __version__
from tests.core.command_line import ball_photo

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WHEEL = f"isc3d-{__version__}-py3-none-any.whl"
SDIST = f"isc3d-{__version__}.tar.gz"
INSTALLED = {"isc_core", "isc_synth", "isc_benchmarks", "isc_blender_addon"}
# Names of the repository that another distribution may have, too.
COMMON = {"synth", "benchmarks", "blender_addon", "training", "tests", "tools"}


@pytest.fixture(scope="module")
def backend() -> ModuleType:
    pytest.importorskip("setuptools")
    path = ROOT / "tools" / "build_backend.py"
    spec = importlib.util.spec_from_file_location("build_backend", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def staged(backend: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tree that a wheel is built from."""
    folder = tmp_path_factory.mktemp("staged")
    backend.stage(ROOT, folder)
    return folder


@pytest.fixture(scope="module")
def wheel(backend: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel, built without a package index."""
    folder = tmp_path_factory.mktemp("wheel")
    code = "import sys, build_backend; build_backend.build_wheel(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", code, str(folder)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT / "tools")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder / WHEEL


def modules(folder: Path) -> Iterator[tuple[Path, ast.Module]]:
    for path in sorted(folder.rglob("*.py")):
        yield path, ast.parse(path.read_text(encoding="utf-8"), str(path))


def imported(folder: Path, path: Path, tree: ast.Module) -> Iterator[tuple[str, ...]]:
    """The modules that a module of the staged tree imports; for `from a import b`, a and b."""
    package = path.relative_to(folder).parts[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else ()
            names = tuple(node.module.split(".")) if node.module else ()
            yield from ((*base, *names, alias.name) for alias in node.names)


def defines(folder: Path, module: tuple[str, ...]) -> bool:
    """Whether a dotted name is a module, or what follows a module's name is a name in it."""
    path = folder.joinpath(*module)
    if path.with_suffix(".py").is_file() or (path / "__init__.py").is_file():
        return True
    parent = folder.joinpath(*module[:-1])
    return parent.with_suffix(".py").is_file() or (parent / "__init__.py").is_file()


@pytest.mark.slow
def test_packages_of_the_wheel_collide_with_no_others(staged: Path) -> None:
    assert {path.name for path in staged.iterdir() if path.is_dir()} == INSTALLED


@pytest.mark.slow
def test_every_import_is_in_the_wheel(staged: Path) -> None:
    wrong = [
        f"{path.relative_to(staged)}: {'.'.join(name)}"
        for path, tree in modules(staged)
        for name in imported(staged, path, tree)
        if name[0] in COMMON or (name[0] in INSTALLED and not defines(staged, name))
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
def test_no_string_names_a_module_of_the_repository(staged: Path) -> None:
    """Such a module would not be found in an installed wheel."""
    pattern = re.compile(rf"({'|'.join(sorted(COMMON - {'tests', 'training'}))})(\.[a-z_]+)+(:|$)")
    wrong = [
        f"{path.relative_to(staged)}:{node.lineno}: {node.value}"
        for path, tree in modules(staged)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and (pattern.match(node.value) or re.search(rf"-m {pattern.pattern}", node.value))
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
def test_what_only_the_repository_uses_stays_out(staged: Path, backend: ModuleType) -> None:
    for name in backend.LEFT_OUT:
        folder, _, rest = name.partition("/")
        assert (ROOT / name).exists()
        assert not (staged / backend.PACKAGES[folder] / rest).exists()
    assert (staged / "isc_benchmarks" / "thesis" / "command.py").is_file()


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("from synth.shapes import SHAPES\n", "from isc_synth.shapes import SHAPES\n"),
        (
            "def f():\n    from synth import (\n        a,\n    )\n",
            "def f():\n    from isc_synth import (\n        a,\n    )\n",
        ),
        ("from synthesis import a\nimport synthesis.b\n", None),
        ("from .synth import a\nfrom isc_core.io import b\n", None),
        ('"""from synth import a"""\n# from synth import b\n', None),
        ('"""`python -m synth.demo_scene`"""\n', '"""`python -m isc_synth.demo_scene`"""\n'),
        (
            "x = 'é'\r\nfrom synth import a\r\n",
            "x = 'é'\r\nfrom isc_synth import a\r\n",
        ),
    ],
)
def test_imports_are_renamed(backend: ModuleType, before: str, after: str | None) -> None:
    renamed = backend.renamed_source(before.encode(), "module.py").decode()
    assert renamed == (before if after is None else after)


@pytest.mark.parametrize("source", ["import synth\n", "import synth.shapes as s\n"])
def test_an_import_that_cannot_be_renamed_ends_the_build(backend: ModuleType, source: str) -> None:
    with pytest.raises(ValueError, match=r"module.py:2: cannot rename synth: write `from synth"):
        backend.renamed_source(f"\n{source}".encode(), "module.py")


@pytest.mark.slow
def test_the_wheel_has_the_licence_the_data_and_the_types(wheel: Path) -> None:
    names = members(wheel)
    assert {f"{package}/py.typed" for package in INSTALLED} <= names
    assert f"isc3d-{__version__}.dist-info/licenses/LICENSE" in names
    data = [
        path
        for folder in ("isc_core", "synth")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and path.suffix not in {".py", ".pyc", ".nbi", ".nbc"}
    ]
    assert len(data) > 10
    missing = {path.relative_to(ROOT).as_posix().replace("synth/", "isc_synth/") for path in data}
    assert missing <= names, missing - names
    assert {name.partition("/")[0] for name in names} == {
        *INSTALLED,
        f"isc3d-{__version__}.dist-info",
    }


def metadata(wheel: Path) -> Message:
    return message_from_bytes(
        zipfile.ZipFile(wheel).read(f"isc3d-{__version__}.dist-info/METADATA")
    )


@pytest.mark.slow
def test_metadata(wheel: Path) -> None:
    told = metadata(wheel)
    assert (told["Name"], told["Version"]) == ("isc3d", __version__)
    assert (told["License-Expression"], told["License-File"]) == ("GPL-3.0-or-later", "LICENSE")
    classifiers = told.get_all("Classifier", [])
    assert "Typing :: Typed" in classifiers
    assert not [one for one in classifiers if one.startswith("License")]  # as PEP 639 demands
    for minor in range(11, 15):  # those that tools/setup.sh accepts
        assert f"Programming Language :: Python :: 3.{minor}" in classifiers
    assert told["Requires-Python"] == ">=3.11"
    assert set(told.get_all("Provides-Extra", [])) == set(PROJECT["optional-dependencies"])


def test_entry_points_name_modules_of_the_wheel(wheel: Path, staged: Path) -> None:
    found = ConfigParser()
    found.read_string(
        zipfile.ZipFile(wheel).read(f"isc3d-{__version__}.dist-info/entry_points.txt").decode()
    )
    named = PROJECT["entry-points"]["isc.commands"]
    installed = {name for name, module in named.items() if not module.startswith("training.")}
    assert set(found["isc.commands"]) == installed
    for section in found.values():
        for reference in section.values():
            module = reference.partition(":")[0].split(".")
            assert module[0] in INSTALLED, reference
            assert defines(staged, tuple(module)), reference


def test_the_citation_names_this_version_and_the_thesis() -> None:
    yaml = pytest.importorskip("yaml")
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= citation.keys()
    assert citation["version"] == __version__
    assert citation["license"] == PROJECT["license"]
    assert citation["keywords"] == PROJECT["keywords"]
    (thesis,) = citation["references"]
    assert (thesis["authors"][0]["family-names"], thesis["year"]) == ("Akbar", 2016)
    assert thesis["title"] in (ROOT / "docs" / "results.md").read_text().replace("\n  ", " ")


def test_the_readme_names_the_wheel() -> None:
    assert f"'dist/{WHEEL}[synth]'" in (ROOT / "README.md").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Environment:
    """A virtual environment, and an empty folder to work in."""

    folder: Path
    work: Path

    def python(self, *words: object) -> subprocess.CompletedProcess[str]:
        return self.run(self.folder / "bin" / "python", *words)

    def isc(self, *words: object) -> str:
        done = self.run(self.folder / "bin" / "isc", *words)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def refused(self, *words: object) -> str:
        done = self.run(self.folder / "bin" / "isc", *words)
        assert done.returncode == 2, done.stderr
        return done.stderr

    def install(self, *words: object) -> subprocess.CompletedProcess[str]:
        """Nothing is compiled to bytecode: most modules are not imported here."""
        quiet = ("--quiet", "--disable-pip-version-check")
        pip = (sys.executable, "-m", "pip", "--python", self.folder, *quiet)
        return self.run(*pip, "install", "--no-compile", *words)

    def run(self, *words: object) -> subprocess.CompletedProcess[str]:
        """Outside of the repository and without the search path that leads there."""
        variables = {name: os.environ[name] for name in os.environ if name != "PYTHONPATH"}
        variables["PIP_CONSTRAINT"] = str(ROOT / "constraints.txt")
        return subprocess.run(
            [str(word) for word in words],
            cwd=self.work,
            env=variables,
            capture_output=True,
            text=True,
            timeout=900,
            check=False,
        )


def environment(folder: Path) -> Environment:
    """Make an empty environment; skip the test where pip can install nothing into it."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    (folder / "work").mkdir()
    made = Environment(folder / "venv", folder / "work")
    patience = ("--retries", "1", "--timeout", "15")
    if made.install("--dry-run", *patience, "setuptools").returncode:
        pytest.skip("pip reaches no package index")
    return made


@pytest.mark.slow
def test_wheel_and_sdist_work_in_an_empty_environment(wheel: Path, tmp_path: Path) -> None:
    pytest.importorskip("build")
    made, dist = environment(tmp_path), tmp_path / "dist"
    # Without a choice of format, build makes the wheel from the sdist.
    built = made.run(sys.executable, "-m", "build", "--outdir", dist, ROOT)
    assert built.returncode == 0, built.stderr
    assert {path.name for path in dist.iterdir()} == {WHEEL, SDIST}
    assert members(dist / WHEEL) == members(wheel)

    installed = made.install(f"{dist / WHEEL}[synth]")
    assert installed.returncode == 0, installed.stderr
    check_the_names(made)
    check_the_commands(made)
    check_the_five_lines(made)


def members(wheel: Path) -> set[str]:
    """Names of the files of a wheel."""
    return set(zipfile.ZipFile(wheel).namelist())


def check_the_names(made: Environment) -> None:
    code = f"""
import sys, isc_core
from importlib.util import find_spec
assert "numpy" not in sys.modules
print(*[name for name in {sorted(COMMON | INSTALLED)} if find_spec(name)])
"""
    done = made.python("-c", code)
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) == INSTALLED


def check_the_commands(made: Environment) -> None:
    assert made.isc("--version") == f"isc {__version__}\n"
    for command in ("synth", "validate", "thesis"):
        assert f"usage: isc {command}" in made.isc(command, "--help")
    made.isc("synth", "--count", 1, "--size", 32, "--samples", 4, "-q", "-o", "set")
    assert list((made.work / "set").rglob("scene.json"))
    # Optional packages that are not installed: the advice names them.
    assert "pip install 'dask[distributed]>=" in made.refused("batch", ".", "-o", "catalogue")
    assert "pip install 'matplotlib>=" in made.refused("thesis", "list")

    for shell in ("bash", "zsh", "fish"):
        script = made.isc("completion", shell)
        assert "decompose" in script and "--max-size" in script and "thesis" in script

    photo = ball_photo(made.work)
    cup = shutil.copy2(photo, made.work / "cup.png")
    made.isc("decompose", photo, "--max-size", 32, "-q", "-o", "small")
    made.isc("decompose", photo, cup, "--model", "naive", "-q", "-o", "naive")
    for folder in ("small", "naive/ball", "naive/cup"):
        assert {"preview.png", "mesh.glb", "maps.exr"} <= {
            path.name for path in (made.work / folder).iterdir()
        }


def check_the_five_lines(made: Environment) -> None:
    assert (made.work / "cup.png").is_file()
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = re.search(r"^```python\n(.*?)^```", readme, re.DOTALL | re.MULTILINE)
    assert lines is not None
    done = made.python("-c", lines[1])
    assert done.returncode == 0, done.stderr
    assert (made.work / "cup" / "preview.png").is_file()
