"""How long does `isc decompose` take, as a whole command, and against another version?

  python -m benchmarks.decomposition.command_time PHOTOS [--against CHECKOUT] [--blender]
  [--rounds N] [--threads N] [--json FILE]

Every photo of the folder PHOTOS is decomposed once in each round, by this checkout and by the other
one in turn, so that both meet the same machine. A first round fills the caches of compiled code and
is not counted. The table has the median over rounds of wall-clock seconds, of the processor's
seconds, and of evaluations of the objective; below are the geometric means over photos, and those
of the ratios. With `--blender`, the command also writes the arrays that the add-on reads, and the
columns are the seconds of the command, of Blender from these arrays to the object in the scene, and
of both.

Limits: processor time grows, too, on a busy machine. The Python module `bpy` stands for Blender;
its start, and drawing, are not included.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from benchmarks.program import run_program

_HERE = Path(__file__).parents[2]
_SUFFIXES = (".png", ".jpg", ".jpeg")
_BUILD = """
import sys, time
import bpy
from blender_addon.files.result_arrays import read_result
from blender_addon.scene.build import BuildOptions, build_object
start = time.perf_counter()
build_object(read_result(sys.argv[1]), BuildOptions(back="rounded"))
print(time.perf_counter() - start)
"""


@dataclass(frozen=True)
class Checkout:
    """A version to measure.

    Attributes
    ----------
    folder : Path
        Its root.
    threads : int
        `--threads`.
    columns : tuple of str
        What `run` returns.
    """

    folder: Path
    threads: int
    columns: ClassVar[tuple[str, ...]] = ("wall", "processor", "evaluations")

    def run(self, photo: Path, output: Path, *options: str) -> tuple[float, ...]:
        """Decompose a photo.

        Parameters
        ----------
        photo, output : Path
        *options : str
            Further options of the command.

        Returns
        -------
        tuple of float
            In the order of `columns`.
        """
        command = ["-m", "isc_core", "decompose", str(photo), "-o", str(output)]
        command += ["--quiet", "--threads", str(self.threads), *options]
        before, start = _processor(), time.perf_counter()
        self.python(output.parent, *command)
        wall, processor = time.perf_counter() - start, _processor() - before
        result = json.loads((output / "decomposition.json").read_text(encoding="utf-8"))
        return wall, processor, float(result["status"]["evaluations"])

    def python(self, folder: Path, *words: str) -> str:
        """Run Python with this version's packages.

        Parameters
        ----------
        folder : Path
            To run in.
        *words : str
            Arguments of Python.

        Returns
        -------
        str
            What it prints.
        """
        # Bytecode is kept, as wherever the package is installed.
        kept = {name: value for name, value in os.environ.items() if name not in _UNSET}
        environment = {
            **kept,
            "PYTHONPATH": str(self.folder),
            "PYTHONPYCACHEPREFIX": str(folder / f"bytecode{hash(self.folder)}"),
        }
        command = [sys.executable, *words]
        return subprocess.run(
            command, env=environment, cwd=folder, check=True, stdout=subprocess.PIPE, text=True
        ).stdout


class InBlender(Checkout):
    """A version of the add-on to measure."""

    columns = ("worker", "Blender", "both")

    def run(self, photo: Path, output: Path, *options: str) -> tuple[float, ...]:
        """Decompose a photo as the add-on does, and build its object.

        Parameters
        ----------
        photo, output : Path
        *options : str
            Further options of the command.

        Returns
        -------
        tuple of float
            In the order of `columns`.
        """
        worker = super().run(photo, output, "--arrays", *options)[0]
        blender = float(self.python(output.parent, "-c", _BUILD, str(output)).split()[-1])
        return worker, blender, worker + blender


_UNSET = ("PYTHONDONTWRITEBYTECODE", "PYTHONPATH")


def _processor() -> float:
    """Seconds that finished child processes have used."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure(checkouts: Sequence[Checkout], photos: list[Path], rounds: int) -> np.ndarray:
    """Measure versions in turn.

    Parameters
    ----------
    checkouts : sequence of Checkout
    photos : list of Path
    rounds : int

    Returns
    -------
    (photos, checkouts, columns) ndarray
        Medians over rounds.
    """
    with tempfile.TemporaryDirectory() as folder:
        for checkout in checkouts:
            checkout.run(photos[0], Path(folder) / "result")
        found = [
            [
                [checkout.run(photo, Path(folder) / "result") for checkout in checkouts]
                for photo in photos
            ]
            for _ in range(rounds)
        ]
    return np.median(np.array(found), axis=0)


def report(photos: list[Path], found: np.ndarray, columns: Sequence[str]) -> str:
    """Format the times.

    Parameters
    ----------
    photos : list of Path
    found : (photos, checkouts, columns) ndarray
    columns : sequence of str

    Returns
    -------
    str
        A Markdown table, and the ratios of the first version to the second.
    """
    versions = ("this", "other")[: found.shape[1]]
    names = [f"{column}, {version}" for version in versions for column in columns]
    lines = ["| photo | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    means = np.exp(np.log(found).mean(axis=0))
    for name, row in [*((p.stem, r) for p, r in zip(photos, found, strict=True)), ("mean", means)]:
        lines.append(f"| {name} | " + " | ".join(f"{value:.2f}" for value in row.ravel()) + " |")
    if found.shape[1] == 2:
        ratio = means[0] / means[1]
        parts = (f"{column} {value:.3f}" for column, value in zip(columns, ratio, strict=True))
        lines.append("\nthis / other: " + ", ".join(parts))
    return "\n".join(lines)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photos", type=Path, metavar="PHOTOS", help="folder of masked photos")
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="root of another version")
    parser.add_argument("--blender", action="store_true", help="build the objects in Blender, too")
    parser.add_argument("--rounds", type=int, default=3, help="default: %(default)s")
    parser.add_argument("--threads", type=int, default=0, help="0 (default) for all cores")
    parser.add_argument("--json", type=Path, help="file to write")
    given = parser.parse_args()
    photos = sorted(p for p in given.photos.iterdir() if p.suffix.lower() in _SUFFIXES)
    if not photos:
        parser.error(f"no photo in {given.photos}")
    version = InBlender if given.blender else Checkout
    others = [] if given.against is None else [given.against.resolve()]
    checkouts = [version(folder, given.threads) for folder in (_HERE, *others)]
    found = measure(checkouts, photos, given.rounds)
    if given.json:
        values = {photo.stem: row.tolist() for photo, row in zip(photos, found, strict=True)}
        given.json.write_text(json.dumps(values), encoding="utf-8")
    print(report(photos, found, version.columns))


if __name__ == "__main__":
    run_program(main)
