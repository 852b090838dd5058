"""The notebook of the documentation: its cells run, and what is stored is what they show."""

import ast
import base64
import importlib
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
PATH = ROOT / "docs" / "quickstart" / "first_decomposition.ipynb"
MOST_BYTES = 500_000

Cell = dict[str, Any]


def stored() -> dict[str, Any]:
    """The notebook as it is in the repository."""
    notebook: dict[str, Any] = json.loads(PATH.read_text(encoding="utf-8"))
    return notebook


def code_cells(notebook: dict[str, Any]) -> list[Cell]:
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def source(cell: Cell) -> str:
    return "".join(cell["source"])


def pictures(notebook: dict[str, Any]) -> list[np.ndarray]:
    """The PNG outputs, (H, W, 3) uint8."""
    return [
        np.asarray(Image.open(io.BytesIO(base64.b64decode(output["data"]["image/png"]))))
        for cell in code_cells(notebook)
        for output in cell["outputs"]
        if "image/png" in output.get("data", {})
    ]


def printed(notebook: dict[str, Any]) -> str:
    return "".join(
        "".join(output["text"])
        for cell in code_cells(notebook)
        for output in cell["outputs"]
        if output["output_type"] == "stream"
    )


def test_it_is_a_valid_notebook_of_a_few_short_cells() -> None:
    nbformat = pytest.importorskip("nbformat")
    nbformat.validate(nbformat.read(PATH, as_version=nbformat.NO_CONVERT))
    assert PATH.stat().st_size < MOST_BYTES
    cells = stored()["cells"]
    assert 8 <= len(cells) <= 16
    assert all(len(source(cell).splitlines()) <= 20 for cell in cells)


def test_its_outputs_are_stored() -> None:
    cells = code_cells(stored())
    assert [cell["execution_count"] for cell in cells] == [*range(1, len(cells) + 1)]
    assert all(cell["outputs"] for cell in cells[1:])  # the first defines things
    assert len(pictures(stored())) == 4
    assert all(picture.std() > 20 for picture in pictures(stored()))


def test_it_names_no_time_and_no_machine() -> None:
    notebook = stored()
    assert set(notebook["metadata"]) == {"kernelspec", "language_info"}
    assert notebook["metadata"]["kernelspec"]["name"] == "python3"
    assert all(cell["metadata"] == {} for cell in notebook["cells"])
    texts = [source(cell) for cell in notebook["cells"]] + [printed(notebook)]
    assert not re.search(r" at 0x|/tmp|\d\d:\d\d", "\n".join(texts))


def test_every_name_of_the_core_exists() -> None:
    text = "\n".join(map(source, code_cells(stored())))
    names = {("isc_core", name) for name in re.findall(r"\bisc_core\.([a-z_]+)\(", text)}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("isc_core"):
            names |= {(node.module or "", alias.name) for alias in node.names}
    assert {("isc_core", name) for name in ("separate", "decompose", "save", "load")} <= names
    missing = [
        f"{module}.{name}"
        for module, name in sorted(names)
        if not hasattr(importlib.import_module(module), name)
    ]
    assert not missing


@pytest.mark.slow
def test_its_cells_run_and_show_what_is_stored(tmp_path: Path) -> None:
    for module in ("nbclient", "ipykernel"):
        pytest.importorskip(module)
    from tools.run_notebook import executed

    notebook = json.loads(json.dumps(executed(PATH, tmp_path)))
    # Other processors round differently, and the solver amplifies it.
    degrees = re.compile(r"\d+(?= degrees)")
    assert degrees.sub("", printed(notebook)) == degrees.sub("", printed(stored()))
    assert all(int(found) < 20 for found in degrees.findall(printed(notebook)))
    for new, old in zip(pictures(notebook), pictures(stored()), strict=True):
        assert np.abs(new.astype(int) - old).mean() < 10
    assert list(tmp_path.iterdir()) == []
