"""Kill batches at random moments and check that nothing is lost or damaged.

  python -m benchmarks.batch.interruptions -o FOLDER [--kills 100] [--images 10]

After each kill the output is checked, and the same command runs again until it is done. Four kinds,
in turn: worker processes, several during one run; the run, whose workers survive; the run and its
workers at once; the scheduler of an external cluster. After each kill every folder of the output is
compared with a reference written by a plain loop: all files byte by byte, decomposition.json except
the timings and the two entries that only a batch writes. The campaign stops at the first difference
or missing file. Every other time the next run starts while orphans of the last may still be at
work. A run that ends must have produced everything, with exit code 0; then the output is deleted.

The rows of FOLDER/kills.jsonl are kept: repeating the command continues the campaign. Images of 36
pixels and no shape solver: the writing is what is tested. About 10 s per kill on two idle cores.
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

from benchmarks.program import run_program
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.photo import read_photo
from isc_core.result_files.result_folder import save

from ..records import append_row, read_rows
from .photos import synthetic_photos

KINDS = ("worker", "run", "run and workers", "run", "scheduler")
_WORKERS_A_RUN = 4
_SIZE = 36
_SETTINGS = Settings(model="retinex", threads=1)
_LONGEST = 1200.0  # seconds of a run before it counts as hung
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
_OWN = ("thumbnails", "summary-pages")


class DamagedOutput(Exception):
    """The output differs from that of an undisturbed run, or a run did not end as it should."""


@dataclass(frozen=True)
class CampaignFolders:
    """The folders of a campaign.

    Attributes
    ----------
    root : Path
        Folder of all files.
    """

    root: Path

    @property
    def photos(self) -> Path:
        """The inputs."""
        return self.root / "photos"

    @property
    def reference(self) -> Path:
        """The results of a plain loop."""
        return self.root / "reference"

    @property
    def output(self) -> Path:
        """The output of the killed runs."""
        return self.root / "output"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the campaign")
    parser.add_argument("--kills", type=int, default=100, help="kills of the campaign")
    parser.add_argument("--images", type=int, default=10, help="photos per run")
    parser.add_argument("--seed", type=int, default=0, help="seed of the moments")
    parser.add_argument("--reference", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    place = CampaignFolders(options.output)
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
    with running(place, cluster=False) as (run, _):  # completes what the last kill left
        check_end(place, run, lost=False)
    print(table(rows))


def make_reference(place: CampaignFolders, count: int) -> None:
    """Write the inputs and the results of a plain loop.

    Must run with one thread: sums in another order differ in the last digits.

    Parameters
    ----------
    place : CampaignFolders
        The folders.
    count : int
        Number of photos.
    """
    for photo in synthetic_photos(place.photos, count, _SIZE):
        if not (place.reference / photo.stem).is_dir():
            save(
                decompose(read_photo(photo), _SETTINGS, name=photo.name),
                place.reference / photo.stem,
            )


def one_run(place: CampaignFolders, kind: str, rng: random.Random) -> dict[str, object]:
    """Start or continue a run, kill at random moments, check after each kill.

    A run that ends before its kill is checked as a whole.

    Parameters
    ----------
    place : CampaignFolders
        The folders.
    kind : str
        One of `KINDS`.
    rng : random.Random
        Draws the moments.

    Returns
    -------
    dict of str to object
        The row.

    Raises
    ------
    DamagedOutput
        If a check fails.
    """
    begun, start, struck, checked = len(results(place.output)), time.monotonic(), 0, []
    with running(place, kind == "scheduler") as (run, scheduler):
        for _ in range(_WORKERS_A_RUN if kind == "worker" else 1):
            if not wait_for_kill(place, run, rng):
                break
            family = [run, *run.children(recursive=True)]
            struck += strike(kind, family, scheduler, rng)
            checked.append(check(place))
        if struck and kind in ("run", "run and workers"):
            if rng.random() < 0.5:
                psutil.wait_procs(family, timeout=60)  # else the next run meets orphans
        else:
            check_end(place, run, lost=kind == "scheduler" and struck > 0)
        check(place)
    seconds = round(time.monotonic() - start, 1)
    return {
        "kind": kind,
        "struck": struck,
        "found": begun,
        "complete": checked,
        "seconds": seconds,
    }


def wait_for_kill(place: CampaignFolders, run: psutil.Process, rng: random.Random) -> bool:
    """Wait until a random number of further results exist, and a little longer.

    Some kills fall into the start, some into the end.

    Parameters
    ----------
    place : CampaignFolders
        The folders.
    run : psutil.Process
        The run.
    rng : random.Random
        Draws the moment.

    Returns
    -------
    bool
        Whether the run is still alive.
    """
    goal = len(results(place.output)) + rng.choice([0, 1, 2, rng.randrange(0, 8)])
    most = len(results(place.reference))
    while alive(run) and len(results(place.output)) < min(goal, most):
        time.sleep(0.02)
    time.sleep(rng.uniform(0.0, rng.choice([0.3, 3.0, 10.0])))
    return alive(run)


def alive(process: psutil.Process) -> bool:
    """Return whether a process is running.

    Parameters
    ----------
    process : psutil.Process

    Returns
    -------
    bool
        False for a zombie.
    """
    return bool(process.is_running() and process.status() != psutil.STATUS_ZOMBIE)


def strike(
    kind: str, family: list[psutil.Process], scheduler: psutil.Process | None, rng: random.Random
) -> bool:
    """Kill processes (SIGKILL), so that nothing can be cleaned up.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    family : list of psutil.Process
        The run and its children.
    scheduler : psutil.Process or None
        Of an external cluster.
    rng : random.Random
        Chooses a worker.

    Returns
    -------
    bool
        Whether there was a process to kill.
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
    """Return the command line of a process.

    Parameters
    ----------
    process : psutil.Process

    Returns
    -------
    list of str
        Empty if the process has ended.
    """
    with contextlib.suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
        return list(process.cmdline())
    return []


def check_end(place: CampaignFolders, run: psutil.Process, lost: bool) -> None:
    """Wait for the end of a run and check its result.

    Parameters
    ----------
    place : CampaignFolders
        The folders.
    run : psutil.Process
        The run.
    lost : bool
        Its scheduler was killed: exit code 2 is right.

    Raises
    ------
    DamagedOutput
        If it hangs, fails or leaves something out.
    """
    try:
        code = run.wait(timeout=_LONGEST)
    except psutil.TimeoutExpired as error:
        run.kill()
        raise DamagedOutput(f"a run did not end within {_LONGEST} s") from error
    if lost and code == 2:
        return
    if code != 0:
        raise DamagedOutput(
            f"a run ended with exit code {code}: {(place.root / 'stderr').read_text()}"
        )
    check(place)
    if not complete(place):
        raise DamagedOutput("a run ended with exit code 0, but results are missing")
    shutil.rmtree(place.output)


@contextmanager
def running(
    place: CampaignFolders, cluster: bool
) -> Iterator[tuple[psutil.Process, psutil.Process | None]]:
    """Start `isc batch`; with `cluster`, on a scheduler and two workers of its own.

    Parameters
    ----------
    place : CampaignFolders
        The folders.
    cluster : bool
        Start an external cluster; it is ended afterwards.

    Yields
    ------
    run : psutil.Process
        The run.
    scheduler : psutil.Process or None
        Of the cluster.
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


def _started(command: list[str], place: CampaignFolders) -> psutil.Process:
    """A process in a session of its own, out of reach of signals to this one."""
    with (place.root / "stderr").open("w") as errors:
        return psutil.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )


def results(output: Path) -> list[Path]:
    """List the results under their final names.

    Parameters
    ----------
    output : Path
        Output folder of the batch.

    Returns
    -------
    list of Path
        Their folders, unsorted; empty if there is no output folder yet.
    """
    if not output.is_dir():
        return []
    return [
        path
        for path in output.iterdir()
        if path.is_dir() and not path.name.startswith(".") and path.name not in _OWN
    ]


def check(place: CampaignFolders) -> int:
    """Compare every result with the reference and check the other files.

    Parameters
    ----------
    place : CampaignFolders
        The folders.

    Returns
    -------
    int
        Number of results.

    Raises
    ------
    DamagedOutput
        If something differs or is incomplete.
    """
    found = results(place.output)
    for folder in found:
        if content(folder) != content(place.reference / folder.name):
            raise DamagedOutput(f"{folder} differs from the reference")
    for picture in (place.output / "thumbnails").glob("[!.]*"):
        if not picture.read_bytes().endswith(b"\xff\xd9"):
            raise DamagedOutput(f"{picture} is incomplete")
    for name in ("summary.html", "summary.csv", "summary.jsonl"):
        text = (place.output / name).read_text() if (place.output / name).exists() else ""
        if text and not text.endswith("\n"):
            raise DamagedOutput(f"{name} is incomplete")
    return len(found)


def content(folder: Path) -> dict[str, bytes | str]:
    """Read all files of a result.

    Parameters
    ----------
    folder : Path
        The result.

    Returns
    -------
    dict
        Content by name; of the description, what does not depend on time and program.
    """
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


def complete(place: CampaignFolders) -> bool:
    """Return whether the output holds a result of every photo.

    Parameters
    ----------
    place : CampaignFolders
        The folders of the campaign.

    Returns
    -------
    bool
        True if the output has the same results by name as the reference.
    """
    return {path.name for path in results(place.output)} == {
        path.name for path in results(place.reference)
    }


def table(rows: list[dict[str, object]]) -> str:
    """Format the campaign as Markdown.

    Parameters
    ----------
    rows : list of dict
        One row per run, as recorded.

    Returns
    -------
    str
        Kills by kind of process, and a line on the results compared after them.
    """
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
            f"{compared} results compared after kills; wrong or incomplete: 0; "
            "runs that did not complete: 0",
        ]
    )


if __name__ == "__main__":
    run_program(main)
