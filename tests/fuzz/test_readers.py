"""Damaged files for every reader: each is read, or refused by `InputError` in one quiet line."""

import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.fuzz.case import MOST_BYTES, Case, Edit, Target, damaged, edits
from tests.fuzz.targets import TARGETS

if not sys.platform.startswith("linux"):
    pytest.skip("the limits of the reading process are those of Linux", allow_module_level=True)
CAMPAIGN = os.environ.get("ISC_TEST_PROFILE") == "campaign"
INPUTS = 20_000 if CAMPAIGN else 250
ROOT = Path(__file__).resolve().parents[2]
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
FOUND = {signal.SIGPROF: "hang", signal.SIGALRM: "hang"}


class Reader:
    """A worker process, started again after a finding."""

    def __init__(self, folder: Path, *command: str) -> None:
        self.files, self.printed = folder / "files", folder / "printed"
        self.command = command or ("-m", "tests.fuzz.worker")
        self.worker: subprocess.Popen[str] | None = None

    def start(self) -> subprocess.Popen[str]:
        """Start the worker with one thread a library."""
        single = {**dict.fromkeys(THREADS, "1"), "MALLOC_ARENA_MAX": "1"}
        with self.printed.open("w") as printed:
            return subprocess.Popen(
                [sys.executable, "-X", "faulthandler", *self.command],
                cwd=ROOT,
                env={**os.environ, **single},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=printed,
                text=True,
            )

    def read(self, target: str, number: int, case: Case, data: bytes) -> str:
        """Have a file read; return "read" or "refused", or raise `AssertionError`."""
        self.worker = self.worker or self.start()
        assert self.worker.stdin is not None and self.worker.stdout is not None
        shutil.rmtree(self.files, ignore_errors=True)
        path = case.put(self.files, data)
        print(target, number, path, file=self.worker.stdin, flush=True)
        answer = self.worker.stdout.readline().strip()
        printed = self.printed.read_text(encoding="utf-8", errors="replace")
        if answer and not printed:
            return answer
        code = self.close()
        kind = FOUND.get(-code, "noise" if answer else "crash" if code < 0 else "exception")
        raise AssertionError(f"{kind} (exit {code}) at {path}:\n{printed[-3000:]}")

    def close(self) -> int:
        """End the worker; return its exit code."""
        if self.worker is None:
            return 0
        self.worker.communicate()
        code, self.worker = self.worker.returncode, None
        return code


def campaign(reader: Reader, target: Target, inputs: int) -> Counter[str]:
    """Read damaged files of one kind; count the answers."""
    cases, answers = target.cases(), Counter[str]()

    @settings(
        max_examples=inputs,
        derandomize=not CAMPAIGN,
        database=None,
        deadline=None,
        phases=(Phase.generate, Phase.shrink) if CAMPAIGN else (Phase.generate,),
        report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.integers(0, len(cases) - 1), edits(target.words))
    def read(number: int, changes: list[Edit]) -> None:
        data = damaged(cases[number], changes)
        answers[reader.read(target.name, number, cases[number], data)] += 1

    read()
    return answers


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reader]:
    made = Reader(tmp_path_factory.mktemp("reader"))
    yield made
    made.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_reader_raises_nothing_but_its_own_error(reader: Reader, name: str) -> None:
    answers = campaign(reader, TARGETS[name], INPUTS)
    share = answers["refused"] / answers.total()
    assert 0.2 < share < 1, f"{share:.0%} refused: the damage is too small or too large"


FAULTY = """
import os, sys, types
kind, sound = sys.argv[1], b"fine and whole"

def read(path):
    if path.read_bytes() == sound:
        return
    if kind == "crash":
        os.abort()
    while kind == "hang":
        pass
    if kind == "noise":
        os.write(2, b"careful!")
    if kind == "memory":
        bytearray(3 << 30)
    if kind == "exception":
        raise KeyError("x")

from tests.fuzz import worker
from tests.fuzz.case import Case, Target
targets = types.ModuleType("targets")
targets.TARGETS = {"faulty": Target("faulty", lambda: (Case("a.bin", sound, read),))}
sys.modules["tests.fuzz.targets"] = targets  # the real ones take a second to load
worker.SECONDS = 0.2
worker.serve()
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("exception", "KeyError"),
        ("noise", "careful!"),
        ("memory", "MemoryError"),
        ("crash", "Abort"),
        ("hang", "hang"),
    ],
)
def test_every_kind_of_fault_is_found(tmp_path: Path, kind: str, message: str) -> None:
    sound = Case("a.bin", b"fine and whole", Path.read_bytes)
    reader = Reader(tmp_path, "-c", FAULTY, kind)
    assert reader.read("faulty", 0, sound, sound.data) == "read"
    with pytest.raises(AssertionError, match=message):
        reader.read("faulty", 0, sound, b"broken")
    assert reader.read("faulty", 0, sound, sound.data) == "read", "a new worker starts"
    assert reader.close() == 0


@pytest.mark.slow
@settings(max_examples=200, derandomize=True, database=None)
@given(edits((b"word",)))
def test_damage_stays_small(changes: list[Edit]) -> None:
    for data in (b"", bytes(range(256)) * 4):
        assert len(damaged(Case("a", data, bytes), changes)) <= MOST_BYTES
