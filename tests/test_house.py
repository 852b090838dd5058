"""The rules of the house, proven on the source itself: which way the imports point, what no module
does, what no file says.
"""

import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np
import pytest

from isc_core.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("isc_core", "synth", "blender_addon", "training", "benchmarks")

# Where image, EXR and mesh libraries may be imported: where files become arrays and arrays become
# files.
IMAGE_LIBRARIES = {
    *("cv2", "PIL", "OpenEXR", "trimesh", "imageio", "skimage", "png", "pillow_heif", "rawpy"),
}
EDGES = (
    "io/exr.py",
    "io/decoders/",
    "photo/mask_overlay.py",
    "result_files/",
)
RENDERERS = {"mitsuba", "drjit"}
BLENDER = {"bpy", "mathutils", "bmesh"}
FORBIDDEN = {
    "isc_core": {"isc_core", "synth", "blender_addon", "training", "benchmarks"}
    | RENDERERS
    | BLENDER,
    "synth": {"blender_addon", "training", "benchmarks"} | BLENDER,
    "blender_addon": {"synth", "training", "benchmarks"} | RENDERERS,
    "training": {"blender_addon", "benchmarks"} | BLENDER,
    "benchmarks": set(),  # the closed loop measures what Blender renders
}
# Modules that build bodies with Blender import it only inside functions.
BUILDERS = "training/world/bodies/"
UNSAFE_MODULES = {"pickle", "cPickle", "dill", "marshal", "shelve"}
LONGEST_FUNCTION = 80
USUAL_FUNCTION = 40
MOST_FILES = 20
MOST_FILES_AT_THE_TOP = 12


def sources(*packages: str) -> list[Path]:
    return sorted(path for package in packages for path in (ROOT / package).rglob("*.py"))


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def where(path: Path, node: ast.AST) -> str:
    return f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 1)}"


def absolute_imports(tree: ast.Module) -> Iterator[tuple[ast.AST, str]]:
    """Each absolute import, at any level of the module, by the first part of the name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node, alias.name.split(".")[0]) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node, node.module.split(".")[0]
        elif isinstance(node, ast.Call) and called(node) in {"__import__", "import_module"}:
            # Names assembled at run time cannot be checked, only literal ones.
            yield from (
                (node, str(name.value).split(".")[0])
                for name in node.args[:1]
                if isinstance(name, ast.Constant)
            )


def called(node: ast.Call) -> str:
    """The last part of the called name."""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def functions(path: Path) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    return (
        node
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    )


def lines_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """The length of a function's body without its docstring."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


@pytest.mark.parametrize("package", PACKAGES)
def test_dependencies_between_packages_have_one_direction(package: str) -> None:
    wrong = [
        f"{where(path, node)} imports {name}"
        for path in sources(package)
        for node, name in absolute_imports(parsed(path))
        if name in FORBIDDEN[package]
        and not (name in BLENDER and node in imports_of_builders(path))
    ]
    assert not wrong, "\n".join(wrong)


def imports_of_builders(path: Path) -> set[ast.AST]:
    """The imports inside of the functions of `BUILDERS`; none of another module."""
    if not path.relative_to(ROOT).as_posix().startswith(BUILDERS):
        return set()
    return {node for function in functions(path) for node in ast.walk(function)}


def test_the_core_touches_files_only_at_its_edges() -> None:
    wrong = [
        f"{where(path, node)} imports {name}"
        for path in sources("isc_core")
        for node, name in absolute_imports(parsed(path))
        if name in IMAGE_LIBRARIES
        and not path.relative_to(ROOT / "isc_core").as_posix().startswith(EDGES)
    ]
    assert not wrong, "\n".join(wrong)


def imported_modules(package: str) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """Each module of `package`, and the modules of the same package that it imports."""
    for path in sources(package):
        parts = path.relative_to(ROOT).with_suffix("").parts
        for node in ast.walk(parsed(path)):
            if not isinstance(node, ast.ImportFrom):
                continue
            base = parts[: len(parts) - node.level] if node.level else ()
            module = (*base, *(node.module or "").split(".")) if node.module else base
            if module[:1] == (package,):
                yield from ((path, (*module, alias.name)) for alias in node.names)


def folder_of(module: tuple[str, ...]) -> tuple[str, ...]:
    """The folder that holds a module, a package, or a name that one of them defines."""
    while not (ROOT.joinpath(*module)).is_dir():
        module = module[:-1]
    return module


def folder_imports(package: str) -> dict[tuple[str, ...], set[tuple[str, ...]]]:
    """Which folders of `package` import which others.

    The package's own top is left out: `errors` and `progress` serve every folder, and `__init__`
    and `__main__` are the doors to them.
    """
    graph: dict[tuple[str, ...], set[tuple[str, ...]]] = {}
    for path, module in imported_modules(package):
        source, target = path.parent.relative_to(ROOT).parts, folder_of(module)
        if len(source) > 1 and len(target) > 1 and source != target:
            graph.setdefault(source, set()).add(target)
    return graph


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_between_folders_make_no_cycle(package: str) -> None:
    graph = folder_imports(package)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join("/".join(folder) for folder in error.args[1]))


# The order of the pipeline: a folder imports only folders earlier in this list.
PIPELINE = (
    "numerics",
    "filters",
    "io",
    "imaging",
    "photo",
    "shading",
    "scene",
    "networks",
    "masking",
    "inpainting",
    "thresholding",
    "illuminant",
    "separation",
    "baselines",
    "sirfs",
    "lobe_fitting",
    "decomposition",
    "refinement",
    "result_files",
    "datasets",
    "evaluation",
    "prior_fitting",
    "editing",
    "batch",
    "cli",
)


def test_imports_of_the_core_follow_the_pipeline() -> None:
    folders = {path.parent.name for path in (ROOT / "isc_core").glob("*/__init__.py")}
    assert folders == set(PIPELINE)
    wrong = [
        f"{'/'.join(source)} imports {'/'.join(target)}"
        for source, targets in folder_imports("isc_core").items()
        for target in targets
        if PIPELINE.index(target[1]) > PIPELINE.index(source[1])
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("package", PACKAGES)
def test_folders_are_small(package: str) -> None:
    counts = Counter(path.parent.relative_to(ROOT).as_posix() for path in sources(package))
    assert {folder: n for folder, n in counts.items() if n > MOST_FILES} == {}
    assert counts["isc_core"] <= MOST_FILES_AT_THE_TOP


def test_the_core_imports_fast() -> None:
    """What starts first imports no numerical library: those take most of a second."""
    code = (
        "import sys, isc_core, isc_core.cli.main; "
        "print(*sys.modules.keys() & {'numpy', 'scipy', 'numba', 'cv2', 'OpenEXR', 'trimesh'})"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []


def test_the_commands_import_no_graphs_and_no_optimisers() -> None:
    """SciPy's take a tenth of the start, and most photos need neither."""
    code = (
        "import sys, isc_core.cli.commands.decompose, isc_core.masking.search; "
        "print(*sys.modules.keys() & {'scipy.sparse.csgraph', 'scipy.optimize'}); "
        "print('isc_core.masking.geodesic_region' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["", "True"]


def test_relative_imports_stay_inside_their_package() -> None:
    """The extension ships the core under another name: an import that climbs out of it would end
    somewhere else.
    """
    wrong = [
        where(path, node)
        for package in PACKAGES
        for path in sources(package)
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ImportFrom) and node.level > len(path.relative_to(ROOT).parts) - 1
    ]
    assert not wrong, "\n".join(wrong)


def test_errors_are_caught_by_name() -> None:
    broad = {"Exception", "BaseException"}
    wrong = []
    for path in sources(*PACKAGES):
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.ExceptHandler):
                caught = node.type.elts if isinstance(node.type, ast.Tuple) else [node.type]
                wrong += [
                    where(path, node)
                    for kind in caught
                    if kind is None or getattr(kind, "id", "") in broad
                ]
    assert not wrong, "\n".join(wrong)


def test_nothing_runs_or_unpacks_what_it_reads() -> None:
    wrong = []
    for path in sources(*PACKAGES):
        tree = parsed(path)
        wrong += [
            f"{where(path, node)} imports {name}"
            for node, name in absolute_imports(tree)
            if name in UNSAFE_MODULES
        ]
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            if isinstance(call.func, ast.Name) and call.func.id in {"eval", "exec"}:
                wrong.append(f"{where(path, call)} calls {call.func.id}")
            loose = {
                k.arg
                for k in call.keywords
                if isinstance(k.value, ast.Constant) and k.value.value is True
            }
            wrong += [
                f"{where(path, call)} passes {name}=True"
                for name in ("shell", "allow_pickle")
                if name in loose
            ]
    assert not wrong, "\n".join(wrong)


def test_functions_are_short() -> None:
    lengths = {
        where(path, function): lines_of(function)
        for path in sources(*PACKAGES)
        for function in functions(path)
    }
    long = [
        f"{place}: {length} lines" for place, length in lengths.items() if length > LONGEST_FUNCTION
    ]
    assert not long, "\n".join(long)
    assert np.percentile(list(lengths.values()), 90) <= USUAL_FUNCTION


def test_every_module_has_a_docstring() -> None:
    silent = [
        str(path.relative_to(ROOT))
        for path in sources(*PACKAGES)
        if parsed(path).body and not ast.get_docstring(parsed(path))
    ]
    assert not silent, "\n".join(silent)


def test_every_public_function_has_a_docstring() -> None:
    silent = [
        f"{where(path, node)} {node.name}"
        for path in sources(*PACKAGES)
        for node in parsed(path).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        and not node.name.startswith("_")
        and not ast.get_docstring(node)
    ]
    assert not silent, "\n".join(silent)


def public_definitions(path: Path) -> Iterator[tuple[str, ast.FunctionDef]]:
    """The public functions of a module and the public methods of its public classes, by name."""
    for node in parsed(path).body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            if not any(ast.unparse(one).endswith("overload") for one in node.decorator_list):
                yield node.name, node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from (
                (f"{node.name}.{method.name}", method)
                for method in node.body
                if isinstance(method, ast.FunctionDef) and not method.name.startswith("_")
            )


def has_section(docstring: str, title: str) -> bool:
    return re.search(rf"^{title}\n-{{{len(title)}}}$", docstring, re.MULTILINE) is not None


def test_public_functions_document_their_parameters() -> None:
    """Numpydoc: `Parameters` where there are any, `Returns` where something is returned."""
    silent = []
    for path in sources(*PACKAGES):
        for name, function in public_definitions(path):
            given = function.args
            parameters = {
                argument.arg
                for argument in [
                    *(given.posonlyargs + given.args + given.kwonlyargs),
                    *filter(None, (given.vararg, given.kwarg)),
                ]
            } - {"self", "cls"}
            docstring = ast.get_docstring(function) or ""
            result = ast.unparse(function.returns) if function.returns else "None"
            returns = result in {"None", "NoReturn"} or any(
                has_section(docstring, title) for title in ("Returns", "Yields")
            )
            if parameters and not (returns and has_section(docstring, "Parameters")):
                silent.append(f"{where(path, function)} {name}")
    assert not silent, "\n".join(silent)


def test_public_dataclasses_document_their_fields() -> None:
    """Each field has its entry in the section `Attributes`, if the docstring exceeds one line."""
    silent = []
    for path in sources("isc_core"):
        for node in parsed(path).body:
            if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):
                continue
            if not any("dataclass" in ast.unparse(one) for one in node.decorator_list):
                continue
            docstring = ast.get_docstring(node) or ""
            if "\n" not in docstring:
                continue
            entries = re.findall(r"^([\w, ]+) : ", docstring, re.MULTILINE)
            documented = {name.strip() for entry in entries for name in entry.split(",")}
            silent += [
                f"{where(path, node)} {node.name}.{field.target.id}"
                for field in node.body
                if isinstance(field, ast.AnnAssign)
                and isinstance(field.target, ast.Name)
                and not field.target.id.startswith("_")
                and (field.target.id not in documented or not has_section(docstring, "Attributes"))
            ]
    assert not silent, "\n".join(silent)


def test_dataclasses_with_arrays_compare_by_identity() -> None:
    """The generated `==` raises for arrays, and takes time at each start."""
    compared = []
    for path in sources(*PACKAGES):
        for node in ast.walk(parsed(path)):
            if not isinstance(node, ast.ClassDef):
                continue
            made = [ast.unparse(one) for one in node.decorator_list]
            fields = [one.annotation for one in node.body if isinstance(one, ast.AnnAssign)]
            holds = any(re.search(r"ndarray|torch\.Tensor", ast.unparse(one)) for one in fields)
            if holds and any("dataclass" in one and "eq=False" not in one for one in made):
                compared.append(f"{where(path, node)} {node.name}")
    assert not compared, "\n".join(compared)


def test_lines_have_at_most_100_columns() -> None:
    """Ruff checks the length of every line (E501), also of docstrings and comments."""
    ruff = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["ruff"]
    assert ruff["line-length"] == 100
    assert "E" in ruff["lint"]["select"] and "E501" not in ruff["lint"]["ignore"]
    exempt = [
        str(path.relative_to(ROOT))
        for path in sources(*PACKAGES)
        if "noqa: E501" in path.read_text(encoding="utf-8")
    ]
    assert not exempt, "\n".join(exempt)


def test_the_command_starts_without_numba() -> None:
    """Some machines have no build of Numba: the plain NumPy engine must do there."""
    code = (
        "import sys; sys.modules['numba'] = None; sys.modules['llvmlite'] = None; "
        "import isc_core.cli.main, isc_core.sirfs.numpy_engine"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_command_starts_without_a_renderer_or_blender() -> None:
    missing = sorted(RENDERERS | BLENDER)
    code = f"import sys; sys.modules.update(dict.fromkeys({missing})); import isc_core.cli.main"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def tracked_texts() -> list[Path]:
    """The files under version control that are text."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("not a git checkout: the list of tracked files is not known")
    binary = {".png", ".exr", ".npz", ".npy", ".glb", ".jpg", ".tiff", ".zip"}
    paths = [ROOT / name for name in listed.stdout.split("\0") if name]
    return [path for path in paths if path.is_file() and path.suffix not in binary]


def test_no_file_names_a_machine_or_a_registry() -> None:
    # Written in parts, so that this file does not contain the strings that it searches for.
    homes = [f"/{folder}/" for folder in ("work", "root", "home", "Users", "opt/py" + "pi")]
    options = [
        "--" + name for name in ("index-url", "extra-index-url", "find-links", "trusted-host")
    ]
    hosts = [
        "py" + "pi.org",
        "python" + "hosted.org",
        "deb." + "debian.org",
        "conda." + "anaconda.org",
    ]
    pattern = re.compile(
        "|".join(rf"(?<![\w.}}-]){re.escape(path)}" for path in homes)
        + "|"
        + "|".join(map(re.escape, options + hosts))
    )
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}"
        for path in tracked_texts()
        if path != Path(__file__).resolve()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if pattern.search(line)
    ]
    assert not found, "\n".join(found)


def test_every_dependency_is_pinned_exactly() -> None:
    lines = [
        line.split("#")[0].strip() for line in (ROOT / "constraints.txt").read_text().splitlines()
    ]
    pins = [line for line in lines if line]
    assert all(re.fullmatch(r"[A-Za-z0-9_.\-]+==[0-9][\w.]*(; .+)?", pin) for pin in pins), pins
    pinned = {plain(re.split("==", pin)[0]) for pin in pins}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = project["dependencies"] + [
        entry for extra in project["optional-dependencies"].values() for entry in extra
    ]
    missing = {plain(re.match(r"[A-Za-z0-9_.\-]+", entry).group()) for entry in wanted} - pinned  # type: ignore[union-attr]
    assert not missing


def plain(name: str) -> str:
    """A distribution's name as installers compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_the_readme_names_commands_and_options_that_exist(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Every `isc COMMAND` of the README starts, and knows the options of its section."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = sorted(set(re.findall(r"\bisc ([a-z][a-z-]+)\b", readme)))
    known = {}
    for command in commands:
        assert main([command, "--help"]) == 0, f"isc {command}"
        known[command] = set(re.findall(r"--[a-z][a-z-]+", capsys.readouterr().out))
    assert {"decompose", "separate", "mask", "evaluate", "fit-priors"} <= set(commands)
    for command in commands:
        section = re.search(rf"### `isc {command}`\n(.*?)(?=\n##)", readme, re.DOTALL)
        lines = [line for line in readme.splitlines() if re.search(rf"\bisc {command} ", line)]
        wanted = set(
            re.findall(r"--[a-z][a-z-]+", "\n".join([*lines, section.group(1) if section else ""]))
        )
        assert wanted <= known[command], f"isc {command} lacks {sorted(wanted - known[command])}"
