"""Does a batch that is killed lose or spoil anything? Kills at random moments, a check after each,
the same command again until it is done.

  python -m benchmarks.batch.interruptions -o FOLDER [--kills 100] [--images 10]

Four kinds, in turn: worker processes, several while a run goes on; the run, whose workers are left
to themselves; the run and its workers at once; the scheduler of a cluster that stands by itself.
After each kill every folder of the output is compared with a reference that a plain loop has
written: all files byte by byte, of decomposition.json all but the seconds and the two entries that
only a batch writes. The campaign stops at the first that is wrong or incomplete. Every other time
the next run begins while orphans of the last may still be at work. A run that comes to its end has
to have made everything, with exit code 0; then the output begins anew.

The rows of FOLDER/kills.jsonl are kept: given again, the command goes on. Images of 36 pixels and
no shape solver: the writing is what is tested. Some 10 s a kill on two quiet cores.
"""

import argparse
import contextlib
import json
import os
import random
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil  # type: ignore[import-untyped]

from isc_core.decompose.pipeline import decompose
from isc_core.decompose.settings import Settings
from isc_core.photo import read_photo
from isc_core.result_files.result_folder import save

from ..records import append_row, read_rows
from .photos import made_photos

KINDS = ("worker", "run", "run and workers", "run", "scheduler")
_WORKERS_A_RUN = 4
_SIZE = 36
_SETTINGS = Settings(model="retinex", threads=1)
_LONGEST = 1200.0  # seconds of a run before it counts as hung
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
_OWN = ("thumbnails", "summary-pages")


class Spoilt(Exception):
    """The output holds what no undisturbed run would have written, or a run did not end as it
    should.
    """


@dataclass(frozen=True)
class Place:
    """The folders of a campaign."""

    root: Path

    @property
    def photos(self) -> Path:
        """The inputs."""
        return self.root / "photos"

    @property
    def reference(self) -> Path:
        """What a plain loop made of them."""
        return self.root / "reference"

    @property
    def output(self) -> Path:
        """What is killed."""
        return self.root / "output"


def main() -> None:
    """Runs the campaign and prints what it found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--images", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reference", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    place = Place(options.output)
    if options.reference:
        make_reference(place, options.images)
        return
    again = [sys.executable, "-m", "benchmarks.batch.interruptions", *sys.argv[1:], "--reference"]
    subprocess.run(again, check=True, env={**os.environ, **_ONE_THREAD})
    log = place.root / "kills.jsonl"
    rows = read_rows(log)
    while (kills := sum(row["struck"] for row in rows)) < options.kills:
        row = one_run(
            place, KINDS[len(rows) % len(KINDS)], random.Random(f"{options.seed} {len(rows)}")
        )
        rows.append(row)
        append_row(log, row)
        print(f"{kills + row['struck']:4d}  {row}", flush=True)
    with running(place, cluster=False) as (run, _):  # what the last kill has left is completed, too
        ended_well(place, run, lost=False)
    print(table(rows))


def make_reference(place: Place, count: int) -> None:
    """The inputs, and a plain loop over them; in a process with one thread, since sums in other
    orders end in other last digits.
    """
    for photo in made_photos(place.photos, count, _SIZE):
        if not (place.reference / photo.stem).is_dir():
            save(
                decompose(read_photo(photo), _SETTINGS, name=photo.name),
                place.reference / photo.stem,
            )


# --- kills ----------------------------------------------------------------------------------------


def one_run(place: Place, kind: str, rng: random.Random) -> dict[str, object]:
    """Starts or goes on, kills at random moments, checks after each.

    A run that ends before its kill is checked as a whole.
    """
    begun, start, struck, complete = len(results(place.output)), time.monotonic(), 0, []
    with running(place, kind == "scheduler") as (run, scheduler):
        for _ in range(_WORKERS_A_RUN if kind == "worker" else 1):
            if not struck_now(place, run, rng):
                break
            family = [run, *run.children(recursive=True)]
            struck += strike(kind, family, scheduler, rng)
            complete.append(check(place))
        if struck and kind in ("run", "run and workers"):
            if rng.random() < 0.5:
                psutil.wait_procs(family, timeout=60)  # else the next run meets those who are left
        else:
            ended_well(place, run, lost=kind == "scheduler" and struck > 0)
        check(place)
    seconds = round(time.monotonic() - start, 1)
    return {
        "kind": kind,
        "struck": struck,
        "found": begun,
        "complete": complete,
        "seconds": seconds,
    }


def struck_now(place: Place, run: psutil.Process, rng: random.Random) -> bool:
    """Waits until so many more results are there as chance says, and a little longer; false where
    the run ends before.

    Some kills come during the start, some during the end.
    """
    goal = len(results(place.output)) + rng.choice([0, 1, 2, rng.randrange(0, 8)])
    most = len(results(place.reference))
    while alive(run) and len(results(place.output)) < min(goal, most):
        time.sleep(0.02)
    time.sleep(rng.uniform(0.0, rng.choice([0.3, 3.0, 10.0])))
    return alive(run)


def alive(process: psutil.Process) -> bool:
    """Whether it still works."""
    return bool(process.is_running() and process.status() != psutil.STATUS_ZOMBIE)


def strike(
    kind: str, family: list[psutil.Process], scheduler: psutil.Process | None, rng: random.Random
) -> bool:
    """Kills by force, so that nothing can be tidied up.

    False where there is nobody to kill yet, or any more.
    """
    workers = [process for process in family[1:] if "spawn_main" in " ".join(command_of(process))]
    victims = {
        "worker": workers and [rng.choice(workers)],
        "run": family[:1],
        "run and workers": family,
        "scheduler": [scheduler] if scheduler else [],
    }[kind]
    for victim in victims:
        with contextlib.suppress(psutil.NoSuchProcess):
            victim.kill()
    return bool(victims)


def command_of(process: psutil.Process) -> list[str]:
    """Its command line, nothing where it has ended."""
    with contextlib.suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
        return list(process.cmdline())
    return []


def ended_well(place: Place, run: psutil.Process, lost: bool) -> None:
    """Waits for the end of a run that was left alone, or lost a worker, or its scheduler, which it
    has to say with exit code 2.
    """
    try:
        code = run.wait(timeout=_LONGEST)
    except psutil.TimeoutExpired as error:
        run.kill()
        raise Spoilt(f"a run hangs: {_LONGEST} s") from error
    if lost and code == 2:
        return
    if code != 0:
        raise Spoilt(f"a run ended with {code}: {(place.root / 'stderr').read_text()}")
    check(place)
    if not whole(place):
        raise Spoilt("a run ended well, but not everything is there")
    shutil.rmtree(place.output)


@contextmanager
def running(place: Place, cluster: bool) -> Iterator[tuple[psutil.Process, psutil.Process | None]]:
    """A run of `isc batch`; with a scheduler and two workers of its own where `cluster`, which are
    ended afterwards.
    """
    command = [
        sys.executable,
        "-m",
        "isc_core",
        "batch",
        str(place.photos),
        "-o",
        str(place.output),
        "--quiet",
    ]
    command += ["--model", "retinex", "--workers", "2", "--threads", "1", "--memory", "0"]
    if not cluster:
        yield _started(command, place), None
        return
    contact = place.root / "scheduler.json"
    contact.unlink(missing_ok=True)
    dask = [str(Path(sys.executable).parent / "dask")]
    there = ["--scheduler-file", str(contact)]
    scheduler = _started(
        [
            *dask,
            "scheduler",
            *there,
            "--host",
            "127.0.0.1",
            "--port",
            "0",
            "--dashboard-address",
            ":0",
        ],
        place,
    )
    workers = _started(
        [*dask, "worker", *there, "--nthreads", "1", "--nworkers", "2", "--death-timeout", "300"],
        place,
    )
    try:
        while not contact.exists() or not (text := contact.read_text()):
            time.sleep(0.1)
        yield _started([*command, "--scheduler", json.loads(text)["address"]], place), scheduler
    finally:
        for process in [
            scheduler,
            workers,
            *(workers.children(recursive=True) if workers.is_running() else []),
        ]:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()


def _started(command: list[str], place: Place) -> psutil.Process:
    """A process in a session of its own, so that no signal for this one reaches it."""
    with (place.root / "stderr").open("w") as told:
        return psutil.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=told,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )


# --- what the output holds ------------------------------------------------------------------------


def results(output: Path) -> list[Path]:
    """The results that stand under their final names."""
    if not output.is_dir():
        return []
    return [
        path
        for path in output.iterdir()
        if path.is_dir() and not path.name.startswith(".") and path.name not in _OWN
    ]


def check(place: Place) -> int:
    """Compares every result with the reference and looks at the other files; returns how many
    results there are. Raises `Spoilt`.
    """
    found = results(place.output)
    for folder in found:
        if content(folder) != content(place.reference / folder.name):
            raise Spoilt(f"{folder} differs from the reference")
    for picture in (place.output / "thumbnails").glob("[!.]*"):
        if not picture.read_bytes().endswith(b"\xff\xd9"):
            raise Spoilt(f"{picture} is not whole")
    for name in ("summary.html", "summary.csv", "summary.jsonl"):
        text = (place.output / name).read_text() if (place.output / name).exists() else ""
        if text and not text.endswith("\n"):
            raise Spoilt(f"{name} is not whole")
    return len(found)


def content(folder: Path) -> dict[str, bytes | str]:
    """All files; of the description what does not depend on when and by whom it was made."""
    files: dict[str, bytes | str] = {
        p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()
    }
    description = json.loads(files.pop("decomposition.json"))
    del description["timings"]
    source = {
        name: value
        for name, value in description["input"].items()
        if name not in ("mask_sha256", "fingerprint")
    }
    return {**files, "description": json.dumps({**description, "input": source}, sort_keys=True)}


def whole(place: Place) -> bool:
    """Whether the output holds a result of every photo."""
    return {path.name for path in results(place.output)} == {
        path.name for path in results(place.reference)
    }


def table(rows: list[dict[str, object]]) -> str:
    """Markdown: kills of each kind, and what was found."""
    struck = [row for row in rows if row["struck"]]
    kinds: Counter[str] = Counter()
    for row in struck:
        kinds[str(row["kind"])] += int(str(row["struck"]))
    compared = sum(sum(json.loads(str(row["complete"]))) for row in rows)
    lines = [
        "| killed | times |",
        "|---|---|",
        *(f"| {kind} | {count} |" for kind, count in sorted(kinds.items())),
    ]
    lines.append(f"| all | {kinds.total()} |")
    return "\n".join(
        [
            *lines,
            "",
            f"{compared} results compared after kills; wrong or incomplete: 0; runs that did not complete: 0",
        ]
    )


if __name__ == "__main__":
    main()
