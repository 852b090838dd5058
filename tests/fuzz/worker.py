"""A process that reads damaged files; it may crash, hang or run out of memory.

Each line of standard input names a target, the number of its case and a file. The answer is "read"
or "refused". The process may allocate 2 GB and spend 5 s of processor time, or 60 s in all, on a
file; the kernel ends it otherwise. A finding ends it with a traceback.
"""

import os
import resource
import signal
import sys
from pathlib import Path

MEMORY = 2 << 30
SECONDS, PATIENCE = 5.0, 60.0
NO_MEMORY = ("nsufficient memory", "bad_alloc", "bad alloc", "Cannot allocate")


def assert_clear(error: BaseException) -> None:
    """Assert that a refusal is printable and not the consequence of exhausted memory."""
    assert str(error).isprintable(), f"not printable: {str(error)!r}"
    cause: BaseException | None = error
    while cause is not None:
        full = isinstance(cause, MemoryError) or any(word in str(cause) for word in NO_MEMORY)
        assert not full, f"out of memory: {cause!r}"
        cause = cause.__cause__ or cause.__context__


def serve() -> None:
    """Answer until standard input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever a reader prints counts as a finding
    from isc_core.errors import InputError
    from tests.fuzz.targets import TARGETS

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    cases = {}
    for line in sys.stdin:
        name, number, path = line.rstrip("\n").split(" ", 2)
        if name not in cases:
            cases[name] = TARGETS[name].cases()
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.setitimer(signal.ITIMER_REAL, PATIENCE)
        try:
            cases[name][int(number)].read(Path(path))
            answer = "read"
        except InputError as error:
            assert_clear(error)
            answer = "refused"
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        print(answer, file=answers, flush=True)


if __name__ == "__main__":
    serve()
