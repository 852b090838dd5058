"""Measure how soon a batch of a million lines starts, and how much memory its list takes.

  python -m benchmarks.batch.manifest -o FOLDER [--lines 1000000]

Writes a manifest of that many lines, of each kind, and starts `isc batch` on it in a process of its
own, with one worker whose task does nothing. Measured: seconds from the start of the process to the
first outcome; outcomes per second; and memory at the first outcome and after 500, against a
manifest of 1000 lines. Then the run is ended. About a minute on two idle cores.
"""

import argparse
import contextlib
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import psutil  # type: ignore[import-untyped]

from benchmarks.program import run_program
from isc_core.batch.engine import WorkerOptions
from isc_core.batch.item import DONE, ImageJob, ImageOutcome, Outcomes
from isc_core.batch.run_batch import Batch, run_batch
from isc_core.errors import Cancelled
from isc_core.progress import Monitor, ProgressEvent

_OUTCOMES = 500


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    parser.add_argument("--lines", type=int, default=1_000_000, help="lines of a manifest")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        start(options.one, options.output)
        return
    options.output.mkdir(parents=True, exist_ok=True)
    print(
        "| manifest | lines | first outcome (target: 20 s) | memory then | outcomes per second "
        "| peak memory |\n|---|---|---|---|---|---|"
    )
    for suffix in (".csv", ".jsonl"):
        for lines in (1000, options.lines):
            path = write_manifest(options.output / f"{lines}{suffix}", lines)
            again = [
                sys.executable,
                "-m",
                "benchmarks.batch.manifest",
                "-o",
                str(options.output / "out"),
                "--one",
                str(path),
            ]
            done = subprocess.run(again, check=True, capture_output=True, text=True)
            print(f"| {suffix} | {lines} | {done.stdout.strip()} |", flush=True)


def write_manifest(path: Path, lines: int) -> Path:
    """Write a manifest in which every folder has a `front.jpg`: names clash often.

    Parameters
    ----------
    path : Path
        The file, .csv or .jsonl; kept if it exists.
    lines : int
        Number of images.

    Returns
    -------
    Path
        The file.
    """
    if not path.exists():
        with path.open("w", encoding="utf-8") as file:
            if path.suffix == ".csv":
                file.write("image,mask,max_size\n")
            for number in range(lines):
                image, mask = (
                    f"catalogue/{number // 3:06d}/{('front', 'side', 'back')[number % 3]}.jpg",
                    f"masks/{number:07d}.png",
                )
                if path.suffix == ".csv":
                    file.write(f"{image},{mask},256\n")
                else:
                    options = '{"max_size": 256}'
                    file.write(f'{{"image": "{image}", "mask": "{mask}", "options": {options}}}\n')
    return path


def start(manifest: Path, output: Path) -> None:
    """Run a batch in this process and print the cells of its row.

    Parameters
    ----------
    manifest : Path
        File that lists the photos.
    output : Path
        Output folder of the batch.
    """
    process, observer = psutil.Process(), RunObserver()
    with contextlib.suppress(Cancelled):
        run_batch(
            Batch([str(manifest)], output, worker_options=WorkerOptions(1, 1, "0")),
            Monitor(observer.progress, observer.enough),
            task=no_task,
        )
    rate = observer.count / (time.time() - observer.first) if observer.first else 0.0
    first = observer.first - process.create_time()
    print(f"{first:.1f} s | {observer.memory:.0f} MB | {rate:.0f} | {_peak_mb():.0f} MB")


class RunObserver:
    """Counts the outcomes of a run.

    Attributes
    ----------
    first : float
        Time of the first outcome; 0 before.
    memory : float
        Peak memory then, MB.
    count : int
        Outcomes so far.
    """

    def __init__(self) -> None:
        self.first = self.memory = 0.0
        self.count = 0

    def progress(self, event: ProgressEvent) -> None:
        """Take a progress event.

        Parameters
        ----------
        event : ProgressEvent
            Its detail contains the number of photos that are done.
        """
        found = re.match(r"done (\d+)", event.detail)
        self.count = int(found.group(1)) if found else 0
        if self.count and not self.first:
            self.first, self.memory = time.time(), _peak_mb()

    def enough(self) -> bool:
        """Return whether the run may end."""
        return self.count >= _OUTCOMES


def no_task(job: ImageJob) -> Outcomes:
    """Do nothing.

    Parameters
    ----------
    job : ImageJob
        Not done.

    Returns
    -------
    Outcomes
        Done.
    """
    return {job.name: ImageOutcome(DONE)}


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    run_program(main)
