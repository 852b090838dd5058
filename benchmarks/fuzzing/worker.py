"""The process that reads: it may crash, hang or eat memory without taking the campaign along.

    python -m benchmarks.fuzzing.worker FOLDER SEED TARGET:FIRST:LAST ...     reads inputs FIRST to
    LAST - 1 of each target python -m benchmarks.fuzzing.worker FOLDER --probe TARGET CASE FILE
    reads FILE as the case of that number

Where it is stands in FOLDER/at (target, number, seconds of the processor when it began); findings
and sums go to FOLDER/log.jsonl. The process gets 2 GB of addresses and one thread a library; what
it prints goes to FOLDER/printed and is a finding.
"""

import faulthandler
import functools
import json
import mmap
import os
import resource
import shutil
import struct
import sys
import time
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

MEMORY = 2 << 30
AT = struct.Struct("<iqd")
_TRIES = 150


def _limit(folder: Path) -> int:
    """Sets the limits of this process; the descriptor of what is printed from now on."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    printed = os.open(folder / "printed", os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
    for number in (1, 2):
        os.dup2(printed, number)
    faulthandler.enable((folder / "crash").open("w"))
    warnings.simplefilter("always")
    return printed


def _peak() -> int:
    """The most memory this process has held since the last call, in bytes."""
    with open("/proc/self/status", encoding="ascii") as status:
        most = next(int(line.split()[1]) for line in status if line.startswith("VmHWM"))
    with open("/proc/self/clear_refs", "w", encoding="ascii") as reset:
        reset.write("5")
    return most << 10


def _place_of(folder: Path) -> mmap.mmap:
    path = folder / "at"
    if not path.exists():
        path.write_bytes(bytes(AT.size))
    with path.open("r+b") as file:
        return mmap.mmap(file.fileno(), AT.size)


def _read_all(folder: Path, seed: int, jobs: list[str], printed: int) -> None:
    from .attempt import Finding, attempt, case_and_data, minimised, put
    from .case import Case
    from .targets import TARGETS

    place, log = _place_of(folder), (folder / "log.jsonl").open("a", encoding="utf-8")

    def tell(**event: Any) -> None:
        log.write(json.dumps(event) + "\n")
        log.flush()

    def again(case: Case, work: Path, shorter: bytes) -> Finding | None:
        return attempt(case, put(case, work, shorter), printed)[1]

    for job in jobs:
        name, first, last = job.split(":")
        target, index = TARGETS[name], list(TARGETS).index(name)
        place[:] = AT.pack(index, -1, time.process_time())
        cases = target.cases()
        refused, most, known, started = 0, 0, set(), time.process_time()
        work = folder / "files" / name
        for number in range(int(first), int(last)):
            case, data = case_and_data(target, cases, seed, number)
            shutil.rmtree(work, ignore_errors=True)
            path = put(case, work, data)
            place[:] = AT.pack(index, number, time.process_time())
            was_refused, found = attempt(case, path, printed)
            refused += was_refused
            most = max(most, _peak())
            if found is not None and found.signature not in known:
                known.add(found.signature)

                place[:] = AT.pack(index, -1, time.process_time())
                small = minimised(data, found, functools.partial(again, case, work), _TRIES)
                tell(
                    target=name,
                    number=number,
                    finding=asdict(found),
                    case=cases.index(case),
                    data=data.hex(),
                    small=small.hex(),
                )
            if (number + 1) % 500 == 0:
                tell(
                    target=name,
                    done=number + 1,
                    refused=refused,
                    most=most,
                    seconds=time.process_time() - started,
                )
                refused, started = 0, time.process_time()
        tell(
            target=name,
            done=int(last),
            refused=refused,
            most=most,
            seconds=time.process_time() - started,
        )


def _probe(folder: Path, name: str, case: int, file: Path, printed: int) -> None:
    from .attempt import attempt, put
    from .targets import TARGETS

    place = _place_of(folder)
    chosen = TARGETS[name].cases()[case]
    path = put(chosen, folder / "files" / name, file.read_bytes())
    place[:] = AT.pack(0, 0, time.process_time())
    attempt(chosen, path, printed)


def main() -> None:
    """See the module."""
    folder = Path(sys.argv[1])
    printed = _limit(folder)
    if sys.argv[2] == "--probe":
        _probe(folder, sys.argv[3], int(sys.argv[4]), Path(sys.argv[5]), printed)
    else:
        _read_all(folder, int(sys.argv[2]), sys.argv[3:], printed)


if __name__ == "__main__":
    main()
