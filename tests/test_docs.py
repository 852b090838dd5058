"""Links, pictures, programs, paths, commands and options in the documentation exist; the site
builds without warnings and loads nothing from other hosts.
"""

import ast
import contextlib
import importlib
import importlib.util
import io
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from isc_core import separation
from isc_core.cli.commands import build_parser
from isc_core.cli.config import apply_config
from isc_core.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PICTURES = {".png", ".jpg"}
MOST_PICTURE_BYTES = 2_000_000
# Pages that tools/docs_site.py makes.
GENERATED = {"changelog.md", "contributing.md", "security.md", "reference/command_line.md"}
# Commands on these pages are checked; the research log keeps historical commands.
GUIDES = ("index.md", "quickstart", "how_to", "methods", "results.md", "concepts.md", "reference")


def pages() -> list[Path]:
    """Return the pages, without the single tables and figures of the thesis."""
    kept = [page for page in sorted(DOCS.rglob("*.md")) if page.parent != DOCS / "thesis"]
    root = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")]
    return [*root, DOCS / "thesis" / "README.md", *kept]


def guides() -> list[Path]:
    """Return README and the pages whose commands a reader would copy."""
    found = [ROOT / "README.md"]
    for name in GUIDES:
        found += sorted((DOCS / name).rglob("*.md")) if "." not in name else [DOCS / name]
    return found


def prose(page: Path) -> str:
    """Return a page without its code blocks."""
    return re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M)


def links(page: Path) -> Iterator[str]:
    """Yield the targets of a page's relative links and pictures, without anchors."""
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if not re.match(r"[a-z]+:|#", target):
            yield target.split("#")[0]


def test_links_and_pictures_exist() -> None:
    missing = []
    for page in pages():
        for target in links(page):
            path = (page.parent / target).resolve()
            inside = path.relative_to(DOCS).as_posix() if path.is_relative_to(DOCS) else ""
            if not path.exists() and inside not in GENERATED and not inside.startswith("api/"):
                missing.append(f"{page.relative_to(ROOT)}: {target}")
    assert not missing, "\n".join(missing)


def test_pictures_are_used_and_small() -> None:
    pictures = {p.resolve() for p in DOCS.rglob("*") if p.suffix in PICTURES}
    pictures = {p for p in pictures if DOCS / "thesis" not in p.parents}
    used = {(page.parent / target).resolve() for page in pages() for target in links(page)}
    assert not pictures - used
    assert sum(p.stat().st_size for p in pictures) <= MOST_PICTURE_BYTES


def test_programs_exist() -> None:
    missing = []
    for page in pages():
        for name in re.findall(r"python -m ((?:\w+\.)*\w+)", page.read_text(encoding="utf-8")):
            path = ROOT / name.replace(".", "/")
            own = any((ROOT / name.split(".")[0]).glob("*.py"))  # not build/, that of the site
            if (
                own
                and not path.with_suffix(".py").is_file()
                and not (path / "__main__.py").is_file()
            ):
                missing.append(f"{page.relative_to(ROOT)}: python -m {name}")
    assert not missing, "\n".join(missing)


def broken_rows(text: str) -> list[str]:
    """Return the rows of Markdown tables that a page would show as text or with shifted cells."""
    broken: list[str] = []
    cells, above = 0, ""
    lines = text.splitlines()
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        found = len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0
        if found and not cells:  # the header
            if above or not re.fullmatch(r"\|(?: *:?-+:? *\|)+", below):
                broken.append(line)
        elif found != cells and found:
            broken.append(line)
        cells, above = (cells or found) if found else 0, line
    return broken


def test_tables_are_whole() -> None:
    table = "| a | b |\n|---|--:|\n| 1 | `x \\| y` |\n"
    assert not broken_rows(table)
    assert broken_rows(table + "| 1 |\n") == ["| 1 |"]
    assert broken_rows(table + "| 1 | `x | y` |\n") == ["| 1 | `x | y` |"]
    assert broken_rows(table + "\n| 3 | stray |\n") == ["| 3 | stray |"]
    assert broken_rows("text\n" + table) == ["| a | b |"]
    broken = [
        f"{page.relative_to(ROOT)}: {row}"
        for page in [*pages(), *(DOCS / "thesis").glob("*.md"), ROOT / "CHANGELOG.md"]
        for row in broken_rows(prose(page))
    ]
    assert not broken, "\n".join(broken)


def test_paths_exist() -> None:
    packages = "isc_core|synth|training|blender_addon|benchmarks|tests|tools"
    pattern = re.compile(rf"`((?:{packages})/[\w./-]+)`")
    missing = [
        f"{page.relative_to(ROOT)}: {path}"
        for page in pages()
        for path in pattern.findall(prose(page))
        if not (ROOT / path).exists() and "half_minimum" not in path
    ]
    assert not missing, "\n".join(missing)


def test_code_imports_what_exists() -> None:
    missing = []
    for page in guides():
        for code in re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.DOTALL | re.M):
            for node in ast.walk(ast.parse(code)):
                if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                    module = importlib.import_module(node.module)
                    missing += [
                        f"{page.relative_to(ROOT)}: {node.module}.{alias.name}"
                        for alias in node.names
                        if not hasattr(module, alias.name)
                    ]
    assert not missing, "\n".join(missing)


def options_of(*command: str) -> set[str]:
    """Return the long options in the help text of a command."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main([*command, "--help"]) == 0
    return set(re.findall(r"--[a-z][a-z-]+", printed.getvalue()))


def test_commands_and_options_exist() -> None:
    known: dict[tuple[str, ...], set[str]] = {}
    wrong = []
    for page in guides():
        for block in re.findall(r"^```text\n(.*?)^```", page.read_text("utf-8"), re.DOTALL | re.M):
            for words in re.findall(r"^\s*(?:\.venv/bin/)?isc ([a-z-]+.*)$", block, re.M):
                command, *rest = words.split()
                names = (command, *(rest[:2] if command == "edit" else ()))
                if command in {"synth", "thesis", "world"} and rest and not rest[0].startswith("-"):
                    names = (command, rest[0])
                known.setdefault(names, options_of(*names))
                wrong += [
                    f"{page.relative_to(ROOT)}: isc {words}"
                    for option in re.findall(r"(?<!\S)--[a-z][a-z-]+", words)
                    if option not in known[names]
                ]
    assert {("decompose",), ("separate",), ("validate",)} <= set(known)
    assert not wrong, "\n".join(wrong)


def test_the_configuration_of_the_guide_is_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (DOCS / "how_to" / "command_line.md").read_text(encoding="utf-8")
    file = re.search(r"^```toml\n(.*?)^```", page, re.DOTALL | re.M)
    assert file is not None
    (tmp_path / "isc.toml").write_text(file.group(1), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for command, option, value in (
        ("decompose cup.png", "max_size", 384),
        ("separate cup.png", "changes", ["ratio_quantile=0.4"]),
        ("edit cup relight", "ambient", 0.3),
    ):
        arguments = [*command.split(), "-o", "out"]
        parser = build_parser(arguments)
        apply_config(parser, arguments)
        assert getattr(parser.parse_args(arguments), option) == value


def test_the_notebook_is_a_page_with_its_outputs() -> None:
    pytest.importorskip("mkdocs")
    notebook = DOCS / "quickstart" / "first_decomposition.ipynb"
    name = notebook.relative_to(DOCS)
    files = importlib.import_module("tools.docs_site")._notebook_page(notebook, name)
    page = files.pop("quickstart/first_decomposition.md")
    assert page.startswith("# First decomposition\n")
    assert len(files) == 4
    for picture, content in files.items():
        assert f"]({Path(picture).name})" in page
        assert content.startswith(b"\x89PNG")
    assert "mean error of the normals" in page


def test_the_guide_to_add_a_method_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (DOCS / "how_to" / "add_a_separation_method.md").read_text(encoding="utf-8")
    code = re.search(r"^```python\n(.*?)^```", page, re.DOTALL | re.M)
    assert code is not None
    (tmp_path / "half_minimum.py").write_text(code.group(1), encoding="utf-8")
    monkeypatch.setattr(separation, "__path__", [*separation.__path__, str(tmp_path)])
    monkeypatch.setattr(separation, "METHODS", (*separation.METHODS, "half_minimum"))
    image = np.random.default_rng(0).uniform(0.1, 0.9, (12, 12, 3)).astype(np.float32)
    mask = np.ones((12, 12), bool)
    split = separation.separate("half_minimum", image, mask, changes={"weight": 0.25})
    np.testing.assert_allclose(split.diffuse + split.specular, image, atol=1e-6)
    np.testing.assert_allclose(split.specular[..., 0], image.min(axis=2) / 4, atol=1e-6)


@pytest.mark.slow
def test_the_site_builds_without_warnings_and_works_offline(tmp_path: Path) -> None:
    if importlib.util.find_spec("mkdocs") is None:
        pytest.skip("needs the extra docs")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", tmp_path],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    loaded = re.compile(r'<(?:script|img|iframe)[^>]+src="(https?:[^"]+)|<link[^>]+href="(https?:)')
    foreign = [
        f"{page.relative_to(tmp_path)}: {match.group(0)}"
        for page in tmp_path.rglob("*.html")
        for match in loaded.finditer(page.read_text(encoding="utf-8"))
    ]
    styles = "".join(p.read_text(encoding="utf-8") for p in tmp_path.rglob("*.css"))
    assert not foreign, "\n".join(foreign)
    assert not re.search(r"url\(['\"]?https?:|@import", styles)
