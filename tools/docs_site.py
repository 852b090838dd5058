"""MkDocs hooks: pages of the documentation site that are derived from other files.

One API page for each package folder of `isc_core`, written as mkdocstrings directives, and one page
with the help text of every command, so that both references follow the code. Notebooks appear with
their stored outputs. CHANGELOG.md, CONTRIBUTING.md and SECURITY.md stay at the root of the
repository and appear as pages; links to these files and to notebooks work in both places.
"""

import base64
import contextlib
import io
import json
import os
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from isc_core.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
CORE = ROOT / "isc_core"
INTERFACE = "isc_core.api"
ROOT_PAGES = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """List the API pages in the navigation."""
    for section in config.nav or []:
        if "API" in section:
            section["API"] = ["api/index.md"] + [
                {_title(folder): _page(folder)} for folder in _folders()
            ]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    pages: dict[str, str | bytes] = {_page(folder): _api_page(folder) for folder in _folders()}
    pages["api/index.md"] = _api_index()
    pages["reference/command_line.md"] = _command_line()
    for source, target in ROOT_PAGES.items():
        pages[target] = (ROOT / source).read_text(encoding="utf-8").replace("](docs/", "](")
    for notebook in sorted(Path(config.docs_dir).rglob("*.ipynb")):
        pages |= _notebook_page(notebook, notebook.relative_to(config.docs_dir))
    for name, content in pages.items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links to notebooks and to files at the root of the repository to their pages."""
    markdown = re.sub(r"(\]\([\w./-]+)\.ipynb\)", r"\1.md)", markdown)
    for source, target in ROOT_PAGES.items():
        markdown = re.sub(
            rf"\]\(((?:\.\./)*){re.escape(source)}", lambda m, t=target: _inside(m[1]) + t, markdown
        )
    return markdown


def _inside(climb: str) -> str:
    return "](" + climb.removeprefix("../")


def _folders() -> list[Path]:
    """The folders of `isc_core` that contain modules, the top-level one first."""
    folders = {path.parent for path in CORE.rglob("*.py") if "__pycache__" not in path.parts}
    return sorted(folders, key=lambda folder: folder.relative_to(ROOT).parts)


def _title(folder: Path) -> str:
    return ".".join(folder.relative_to(ROOT).parts)


def _page(folder: Path) -> str:
    return f"api/{'_'.join(folder.relative_to(ROOT).parts)}.md"


def _modules(folder: Path) -> list[str]:
    names = [path.stem for path in sorted(folder.glob("*.py"))]
    # `isc_core` shows what `isc_core.api` defines.
    public = [n for n in names if not n.startswith("_") and f"{_title(folder)}.{n}" != INTERFACE]
    return [_title(folder)] * ("__init__" in names) + [f"{_title(folder)}.{n}" for n in public]


def _api_page(folder: Path) -> str:
    return f"# {_title(folder)}\n\n" + "\n".join(map(_directive, _modules(folder)))


def _directive(module: str) -> str:
    options = ["show_submodules: false"]
    if module == "isc_core":
        # The Python interface, its functions first.
        options += ["members_order: __all__", "group_by_category: false"]
    return f"::: {module}\n    options:\n" + "".join(f"      {one}\n" for one in options)


def _summary(folder: Path) -> str:
    """The first line of a package's docstring."""
    init = folder / "__init__.py"
    match = re.match(r'\s*"""(.+?)(?:\n\n|""")', init.read_text(encoding="utf-8"), re.DOTALL)
    return " ".join(match[1].split()) if match else ""


def _api_index() -> str:
    rows = [
        f"| [{_title(folder)}]({Path(_page(folder)).name}) | {_summary(folder)} |"
        for folder in _folders()
        if (folder / "__init__.py").is_file()
    ]
    return (
        "# API reference\n\n"
        "Generated from the docstrings, one page for each folder of `isc_core`. Most programs need "
        "the first page alone: [isc_core](isc_core.md), the Python interface. Conventions of "
        "arrays, frames and units: [Concepts](../concepts.md).\n\n"
        "| package | contents |\n| --- | --- |\n" + "\n".join(rows) + "\n"
    )


def _notebook_page(notebook: Path, name: Path) -> dict[str, str | bytes]:
    """The page of a notebook and its pictures, by their names in the site."""
    files: dict[str, str | bytes] = {}
    parts = []
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {})
            if "image/png" in data:
                picture = f"{name.stem}_{len(files) + 1}.png"
                files[str(name.with_name(picture))] = base64.b64decode(data["image/png"])
                parts.append(f"![Output of the cell above]({picture})")
            else:
                text = "".join(output.get("text") or data["text/plain"])
                parts.append(f"```text\n{text.rstrip()}\n```")
    title, _, rest = "\n\n".join(parts).partition("\n")
    download = f'<a href="{name.name}" download>Download this notebook</a>'
    return {str(name.with_suffix(".md")): f"{title}\n\n{download}\n{rest}\n", **files}


def _help(*command: str) -> str:
    """The output of `isc COMMAND --help`."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        main([*command, "--help"])
    return printed.getvalue()


def _choices(text: str) -> list[str]:
    """The names in the first list of choices of a help text that are subcommands."""
    return re.findall(r"^ {4}([a-z][a-z-]+)(?: |$)", text, re.MULTILINE)


def _command_line() -> str:
    os.environ["COLUMNS"] = "96"
    top = _help()
    parts = ["# Command line", "Generated from the help texts.", f"```text\n{top}```"]
    for command in _choices(top):
        text = _help(command)
        parts += [f"## isc {command}", f"```text\n{text}```"]
        if command == "edit":
            for action in _choices(_help("edit", "RESULT")):
                parts += [
                    f"### isc edit RESULT {action}",
                    f"```text\n{_help('edit', 'RESULT', action)}```",
                ]
    return "\n\n".join(parts) + "\n"
