"""What does `isc batch` cost beside a plain loop, and does its memory stay flat?

  python -m benchmarks.batch.throughput -o FOLDER [--images 200] [--size 256] [--model joint]

The same photos, made here: a plain loop over them (read, decompose, write) with one thread, the
loop with two, and `isc batch` with two workers of one thread each; each in processes of its own.
Then `isc batch` once more, which finds everything done, and for one photo alone: their difference
is what the runner costs for an image (scheduling, checksums, looking whether it is done, journal,
summary), to which the drawing of a thumbnail comes. Memory: of the workers' peaks at each image, as
the system counts them, the greatest of the last 50 images against that of the first 50.

What is measured is kept in FOLDER: given again, the command goes on with what is missing, also in
the middle of a loop. 200 images of 256 x 256 with the model joint take about 35 minutes on two
quiet cores.
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

from isc_core.decompose.pipeline import decompose
from isc_core.decompose.settings import Settings
from isc_core.photo import read_photo
from isc_core.result_files.contact_sheet import thumbnail
from isc_core.result_files.result_folder import save

from ..records import append_row, read_rows
from .photos import made_photos

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_WARM = 50  # images of which a peak is taken, at each end


def main() -> None:
    """Measures what is missing and prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--model", default="joint")
    parser.add_argument("--loop", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    photos = made_photos(options.output / f"photos-{options.size}", options.images, options.size)
    if options.loop:
        plain_loop(options.output, photos, options.model, options.loop)
        return
    for threads in (1, 2):
        command = [
            sys.executable,
            "-m",
            "benchmarks.batch.throughput",
            *sys.argv[1:],
            "--loop",
            str(threads),
        ]
        subprocess.run(
            command, check=True, env={**os.environ, **dict.fromkeys(_THREADS, str(threads))}
        )
    first, again = (
        batch(options.output, photos[0].parent, options.model, which)
        for which in ("first", "again")
    )
    alone = batch(options.output, photos[0], options.model, "alone")
    print(table(options.output, first, again, alone))


# --- the loop -------------------------------------------------------------------------------------


def plain_loop(place: Path, photos: list[Path], model: str, threads: int) -> None:
    """Seconds of each photo, without what the first of a process takes to load; those that are
    known are left out.
    """
    log = place / f"loop-{threads}.jsonl"
    known = {row["photo"] for row in read_rows(log)}
    missing = [photo for photo in photos if photo.name not in known]
    settings = Settings(model=model, threads=threads)
    for number, photo in enumerate([*missing[:1], *missing]):
        start = time.perf_counter()
        save(
            decompose(read_photo(photo), settings, name=photo.name),
            place / f"loop-{threads}" / photo.stem,
        )
        if number:
            append_row(log, {"photo": photo.name, "seconds": time.perf_counter() - start})


# --- the batch ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """One run of `isc batch`: its seconds as a whole, and those and the peak memory in MB of each
    image, in the inputs' order.
    """

    whole: float
    seconds: list[float]
    peaks: list[float]


def batch(place: Path, photos: Path, model: str, which: str) -> Run:
    """Runs `isc batch` with two workers, unless that is known: the `first` time, or one that finds
    everything done.
    """
    log, output = place / f"batch-{which}.json", place / "batch"
    if not log.exists():
        if which == "first":  # one that was broken off would go on, and take too few seconds
            shutil.rmtree(output, ignore_errors=True)
        command = [
            sys.executable,
            "-m",
            "isc_core",
            "batch",
            str(photos),
            "-o",
            str(output),
            "--model",
            model,
            "--quiet",
        ]
        start = time.perf_counter()
        subprocess.run([*command, "--workers", "2", "--threads", "1"], check=True)
        whole = time.perf_counter() - start
        images = read_rows(output / "summary.jsonl")
        if {row["status"] for row in images} != {"done" if which == "first" else "skipped"}:
            raise SystemExit(
                f"{output}: not what was expected of the run `{which}`: delete it and {log.name}, and begin again"
            )
        found = Run(whole, [row["seconds"] for row in images], [row["peak_mb"] for row in images])
        log.write_text(json.dumps(asdict(found)))
    return Run(**json.loads(log.read_text()))


def thumbnail_seconds(place: Path) -> float:
    """Of one, the median of ten."""
    sheets = sorted((place / "batch").glob("*/preview.png"))[:10]
    taken = []
    for sheet in sheets:
        start = time.perf_counter()
        thumbnail(sheet, place / "thumbnail.jpg")
        taken.append(time.perf_counter() - start)
    return median(taken)


def table(place: Path, first: Run, again: Run, alone: Run) -> str:
    """Markdown: what was measured beside what is asked for."""
    loops = [
        sum(row["seconds"] for row in read_rows(place / f"loop-{threads}.jsonl"))
        for threads in (1, 2)
    ]
    count, small = len(first.seconds), thumbnail_seconds(place)
    runner = 2 * (again.whole - alone.whole) / max(count - 1, 1)
    start, end = (max(peaks) for peaks in (first.peaks[:_WARM], first.peaks[-_WARM:]))
    growth = f"{start:.0f} MB, {end:.0f} MB: {100 * (end / start - 1):+.1f} %"
    lines = [
        f"{count} photos, {platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}",
        "",
        "| what | measured | asked for |",
        "|---|---|---|",
        f"| loop, one thread | {loops[0]:.1f} s, {loops[0] / count:.2f} s an image | |",
        f"| loop, two threads | {loops[1]:.1f} s, {loops[1] / count:.2f} s an image | |",
        f"| isc batch, two workers, with its start and end | {first.whole:.1f} s | |",
        f"| of that start and end | {alone.whole:.1f} s | |",
        f"| against the loop with one thread | {loops[0] / first.whole:.2f} x | 1.8 x |",
        f"| against the loop with two threads | {loops[1] / first.whole:.2f} x | 1.0 x |",
        f"| the runner, for an image | {1e3 * runner:.1f} ms, and {1e3 * small:.1f} ms for its thumbnail | 50 ms |",
        f"| everything done already | {again.whole:.1f} s | |",
        f"| peak memory of a worker, first and last {_WARM} images | {growth} | 5 % |",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
