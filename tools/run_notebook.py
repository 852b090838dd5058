"""Run a notebook of the documentation and store the outputs of its cells.

    .venv/bin/python tools/run_notebook.py docs/quickstart/first_decomposition.ipynb

The stored file depends only on the cells and their output: it has no times, versions or machine
names, some of which Jupyter's own "Save" writes.
"""

import argparse
import os
import tempfile
from pathlib import Path

import nbformat
from jupyter_client.kernelspec import KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}
_SECONDS = 600  # for one cell


def executed(path: Path, folder: Path) -> nbformat.NotebookNode:
    """Run a notebook with this interpreter.

    Parameters
    ----------
    path : Path
        The notebook; it is not changed.
    folder : Path
        Current folder of the cells.

    Returns
    -------
    NotebookNode
        The notebook with the outputs of this run.

    Raises
    ------
    CellExecutionError
        If a cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    # Without folders to search, the kernel is that of this interpreter.
    specs = KernelSpecManager(kernel_dirs=[])
    kernel = AsyncKernelManager(kernel_name="python3", kernel_spec_manager=specs)
    client = NotebookClient(
        notebook,
        km=kernel,
        timeout=_SECONDS,
        extra_arguments=["--log-level=ERROR"],
        record_timing=False,
        resources={"metadata": {"path": str(folder)}},
    )
    client.execute(env={**os.environ, "PYTHONPATH": str(ROOT)})
    notebook.metadata = nbformat.from_dict(METADATA)
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            output.get("data", {}).pop("image/jpeg", None)  # Pillow provides every picture twice
    return notebook


def main() -> None:
    """Run the notebook given on the command line, and overwrite it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("notebook", type=Path)
    path = parser.parse_args().notebook
    with tempfile.TemporaryDirectory() as folder:
        nbformat.write(executed(path, Path(folder)), path)


if __name__ == "__main__":
    main()
