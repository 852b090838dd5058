"""How soon does a batch of a million lines start, and how much memory does its list take?

  python -m benchmarks.batch.manifest -o FOLDER [--lines 1000000]

Writes a manifest of so many lines, of each kind, and starts `isc batch` on it in a process of its
own, with one worker process whose task does nothing. Measured: seconds from the process's start to
the first outcome; how fast outcomes come; and the process's memory when the first outcome is there
and after 500 of them, against a manifest of 1000 lines. Then the run is ended. About a minute on
two quiet cores.
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

from isc_core.batch.engine import Crew
from isc_core.batch.item import DONE, ImageJob, ImageOutcome
from isc_core.batch.run_batch import Batch, run_batch
from isc_core.errors import Cancelled
from isc_core.progress import Monitor, ProgressEvent

_OUTCOMES = 500


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--lines", type=int, default=1_000_000)
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        start(options.one, options.output)
        return
    options.output.mkdir(parents=True, exist_ok=True)
    print(
        "| manifest | lines | first outcome (asked for: 20 s) | memory then | outcomes a second | peak memory |\n|---|---|---|---|---|---|"
    )
    for suffix in (".csv", ".jsonl"):
        for lines in (1000, options.lines):
            path = written(options.output / f"{lines}{suffix}", lines)
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


def written(path: Path, lines: int) -> Path:
    """A manifest in which every folder has a `front.jpg`, so that most names are wanted by many."""
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
                    file.write(
                        f'{{"image": "{image}", "mask": "{mask}", "options": {{"max_size": 256}}}}\n'
                    )
    return path


def start(manifest: Path, output: Path) -> None:
    """One run, in this process; prints the cells of its row."""
    process, told = psutil.Process(), Told()
    with contextlib.suppress(Cancelled):
        run_batch(
            Batch([str(manifest)], output, crew=Crew(1, 1, "0")),
            Monitor(told.progress, told.enough),
            task=nothing,
        )
    rate = told.count / (time.time() - told.first) if told.first else 0.0
    first = told.first - process.create_time()
    print(f"{first:.1f} s | {told.memory:.0f} MB | {rate:.0f} | {_peak_mb():.0f} MB")


class Told:
    """What a run has reported."""

    def __init__(self) -> None:
        self.first = self.memory = 0.0
        self.count = 0

    def progress(self, event: ProgressEvent) -> None:
        """Takes the report of a run."""
        found = re.match(r"done (\d+)", event.detail)
        self.count = int(found.group(1)) if found else 0
        if self.count and not self.first:
            self.first, self.memory = time.time(), _peak_mb()

    def enough(self) -> bool:
        """Whether the run may end."""
        return self.count >= _OUTCOMES


def nothing(job: ImageJob) -> ImageOutcome:
    """The task of these runs."""
    del job
    return ImageOutcome(DONE)


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
