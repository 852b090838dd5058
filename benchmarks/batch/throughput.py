"""Measure the cost of `isc batch` beside a plain loop, and whether its memory stays flat.

  python -m benchmarks.batch.throughput -o FOLDER [--images 200] [--size 256] [--model joint]

The same synthetic photos: a plain loop over them (read, decompose, write) with one thread, the loop
with two, and `isc batch` with two workers of one thread; each in processes of its own. Then `isc
batch` again, which finds everything done, and for one photo: their difference is the runner's cost
per image (scheduling, checksums, status check, journal, summary), plus the thumbnail. Memory: the
largest of the workers' peaks over the last 50 images against that over the first 50.

Measurements are kept in FOLDER: repeating the command continues, also within a loop. 200 images of
256 x 256 with the model joint take about 35 minutes on two idle cores.
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

from benchmarks.program import run_program
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.photo import read_photo
from isc_core.result_files.contact_sheet import thumbnail
from isc_core.result_files.result_folder import save

from ..records import append_row, read_rows
from .photos import synthetic_photos

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_WARM = 50  # images of which a peak is taken, at each end


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder of the measurements"
    )
    parser.add_argument("--images", type=int, default=200, help="number of photos")
    parser.add_argument("--size", type=int, default=256, help="side in pixels")
    parser.add_argument("--model", default="joint", help="model of isc decompose")
    parser.add_argument("--loop", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    photos = synthetic_photos(
        options.output / f"photos-{options.size}", options.images, options.size
    )
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


def plain_loop(place: Path, photos: list[Path], model: str, threads: int) -> None:
    """Measure the seconds per photo of a plain loop; known photos are skipped.

    The first photo of a process is run twice: loading and compilation do not count.

    Parameters
    ----------
    place : Path
        Folder of the measurements.
    photos : list of Path
        The inputs.
    model : str
        Model of `isc decompose`.
    threads : int
        Threads.
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


@dataclass(frozen=True)
class BatchRun:
    """One run of `isc batch`.

    Attributes
    ----------
    whole : float
        Seconds from start to end.
    seconds : list of float
        Per image, in the order of the inputs.
    peaks : list of float
        Peak memory per image, MB.
    """

    whole: float
    seconds: list[float]
    peaks: list[float]


def batch(place: Path, photos: Path, model: str, which: str) -> BatchRun:
    """Run `isc batch` with two workers, unless the measurement exists.

    Parameters
    ----------
    place : Path
        Folder of the measurements.
    photos : Path
        The inputs.
    model : str
        Model of `isc decompose`.
    which : {"first", "again", "alone"}
        Name of the run.

    Returns
    -------
    BatchRun
        The measurement.
    """
    log, output = place / f"batch-{which}.json", place / "batch"
    if not log.exists():
        if which == "first":  # an interrupted run would continue, and take too little time
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
                f"unexpected status in `{output}` after the run `{which}`; "
                f"delete it and `{log.name}`, then repeat the command"
            )
        found = BatchRun(
            whole, [row["seconds"] for row in images], [row["peak_mb"] for row in images]
        )
        log.write_text(json.dumps(asdict(found)))
    return BatchRun(**json.loads(log.read_text()))


def thumbnail_seconds(place: Path) -> float:
    """Return the median seconds of a thumbnail, over ten.

    Parameters
    ----------
    place : Path
        Folder of the measurement; its subfolder `batch` contains the results.

    Returns
    -------
    float
        Seconds.
    """
    sheets = sorted((place / "batch").glob("*/preview.png"))[:10]
    taken = []
    for sheet in sheets:
        start = time.perf_counter()
        thumbnail(sheet, place / "thumbnail.jpg")
        taken.append(time.perf_counter() - start)
    return median(taken)


def table(place: Path, first: BatchRun, again: BatchRun, alone: BatchRun) -> str:
    """Format the measurements beside the targets.

    Parameters
    ----------
    place : Path
        Folder of the measurements.
    first, again, alone : BatchRun
        The runs.

    Returns
    -------
    str
        Markdown.
    """
    loops = [
        sum(row["seconds"] for row in read_rows(place / f"loop-{threads}.jsonl"))
        for threads in (1, 2)
    ]
    count, small = len(first.seconds), thumbnail_seconds(place)
    runner = 2 * (again.whole - alone.whole) / max(count - 1, 1)
    start, end = (max(peaks) for peaks in (first.peaks[:_WARM], first.peaks[-_WARM:]))
    growth = f"{start:.0f} MB, {end:.0f} MB: {100 * (end / start - 1):+.1f} %"
    lines = [
        f"{count} photos, {platform.machine()}, {os.cpu_count()} cores, "
        f"Python {platform.python_version()}",
        "",
        "| quantity | measured | target |",
        "|---|---|---|",
        f"| loop, one thread | {loops[0]:.1f} s, {loops[0] / count:.2f} s per image | |",
        f"| loop, two threads | {loops[1]:.1f} s, {loops[1] / count:.2f} s per image | |",
        f"| isc batch, two workers, start to end | {first.whole:.1f} s | |",
        f"| of that, start and end | {alone.whole:.1f} s | |",
        f"| against the loop with one thread | {loops[0] / first.whole:.2f} x | 1.8 x |",
        f"| against the loop with two threads | {loops[1] / first.whole:.2f} x | 1.0 x |",
        f"| the runner, per image | {1e3 * runner:.1f} ms, plus {1e3 * small:.1f} ms for the "
        "thumbnail | 50 ms |",
        f"| everything already done | {again.whole:.1f} s | |",
        f"| peak memory of a worker, first and last {_WARM} images | {growth} | 5 % |",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    run_program(main)
