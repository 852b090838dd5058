"""Runs workers, watches them, and keeps what they find.

A worker that dies has crashed at the input that it was reading; one that has spent 5 s of the
processor on an input (or waited a minute) hangs and is killed. Both are findings, and a new worker
goes on behind that input. `state.json` says how far each target is: a campaign goes on where it was
stopped; each finding gets a folder with the whole input, the smallest one that shows the same, and
a record.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from isc_core.atomic import new_file
from isc_core.errors import InputError

from .attempt import Finding, case_and_data, checksum, minimised
from .targets import TARGETS
from .worker import AT

WORKER = ("-m", "benchmarks.fuzzing.worker")
HANG = 5.0  # seconds of the processor for one input
_WAIT, _LOOK, _TRIES = 60.0, 0.2, 24
_START = 120.0  # seconds of the processor for the imports and the sound files


@dataclass(frozen=True)
class State:
    """Of a target. `done`: inputs read; `refused`: with `InputError`; `most`: bytes of memory held
    at most; `seconds` of the processor; `findings`: the folders' names.
    """

    done: int = 0
    refused: int = 0
    most: int = 0
    seconds: float = 0.0
    findings: tuple[str, ...] = ()


@dataclass
class Campaign:
    """All of it. `output`: the folder. `states`: by target."""

    output: Path
    seed: int
    inputs: int
    states: dict[str, State] = field(default_factory=dict)

    @classmethod
    def opened(cls, output: Path, targets: Iterable[str], seed: int, inputs: int) -> "Campaign":
        """A new campaign, or the one that `output` holds.

        Raises `InputError` for one of another seed, and for unknown targets.
        """
        if unknown := [name for name in targets if name not in TARGETS]:
            raise InputError(f"unknown reader {unknown[0]}: choose of {', '.join(TARGETS)}")
        output.mkdir(parents=True, exist_ok=True)
        held: dict[str, Any] = {"seed": seed, "states": {}}
        if (output / "state.json").is_file():
            held = json.loads((output / "state.json").read_text(encoding="utf-8"))
        if held["seed"] != seed:
            raise InputError(
                f"{output} holds a campaign with the seed {held['seed']}: give that, or another folder"
            )
        states = {
            name: State(**{**value, "findings": tuple(value["findings"])})
            for name, value in held["states"].items()
        }
        return cls(output, seed, inputs, {**{name: State() for name in targets}, **states})

    def run(self, targets: Iterable[str]) -> None:
        """Reads what is missing of each target, all in one process as long as it lives."""
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            while jobs := [
                f"{n}:{self.states[n].done}:{self.inputs}"
                for n in targets
                if self.states[n].done < self.inputs
            ]:
                words = [str(folder), str(self.seed), *jobs]
                how = _watched(words, folder, lambda: self._take(folder))
                self._take(folder)
                if how is not None:
                    self._stopped(folder, how)
                self._save()

    def _take(self, folder: Path) -> None:
        """Takes over what the worker has written."""
        log = folder / "log.jsonl"
        if not log.exists():
            return
        events = [
            json.loads(line)
            for line in log.read_text(encoding="utf-8").splitlines(keepends=True)
            if line.endswith("\n")
        ]
        os.truncate(log, 0)
        for event in events:
            state = self.states[event["target"]]
            if "finding" in event:
                found = Finding(**event["finding"])
                data, small = (bytes.fromhex(event[key]) for key in ("data", "small"))
                self._keep(event["target"], event["number"], event["case"], found, data, small)
            else:
                sums = {
                    "refused": state.refused + event["refused"],
                    "seconds": state.seconds + event["seconds"],
                }
                self.states[event["target"]] = replace(
                    state, done=event["done"], most=max(state.most, event["most"]), **sums
                )
        if events:
            self._save()

    def _stopped(self, folder: Path, how: str) -> None:
        """A worker that crashed or hung: the finding, and on behind it."""
        index, number, _ = AT.unpack((folder / "at").read_bytes())
        name = list(TARGETS)[index]
        if number < 0:
            raise RuntimeError(
                f"the worker for {name} did not come to reading ({how}): {(folder / 'printed').read_text('utf-8', 'replace')}"
            )
        cases = TARGETS[name].cases()
        case, data = case_and_data(TARGETS[name], cases, self.seed, number)
        found = _finding(folder, how)
        print(f"{name}: {found.kind} at input {number}, making it smaller", flush=True)

        def again(shorter: bytes) -> Finding | None:
            (folder / "probe").write_bytes(shorter)
            end = _watched(
                [str(folder), "--probe", name, str(cases.index(case)), str(folder / "probe")],
                folder,
            )
            return None if end is None else _finding(folder, end)

        known = any(
            asdict(found) == self._record(kept)["finding"] for kept in self.states[name].findings
        )
        small = data if known else minimised(data, found, again, _TRIES)
        self._keep(name, number, cases.index(case), found, data, small)
        self.states[name] = replace(self.states[name], done=number + 1)

    def _record(self, kept: str) -> dict[str, Any]:
        record: dict[str, Any] = json.loads(
            (self.output / kept / "finding.json").read_text(encoding="utf-8")
        )
        return record

    def _keep(
        self, name: str, number: int, case: int, found: Finding, data: bytes, small: bytes
    ) -> None:
        """A folder for a finding that is new."""
        kept = f"{name}-{found.kind}-{checksum(found.signature)}"
        if kept in self.states[name].findings:
            return
        folder = self.output / kept
        folder.mkdir(exist_ok=True)
        chosen = TARGETS[name].cases()[case]
        (folder / "input").write_bytes(chosen.wrap(data))
        (folder / f"small-{Path(chosen.name).name}").write_bytes(chosen.wrap(small))
        record = {
            "target": name,
            "seed": self.seed,
            "number": number,
            "case": case,
            "finding": asdict(found),
        }
        (folder / "finding.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
        self.states[name] = replace(self.states[name], findings=(*self.states[name].findings, kept))
        print(f"{name}: {found.signature}: {found.detail}", flush=True)

    def _save(self) -> None:
        states = {name: asdict(state) for name, state in self.states.items()}
        with new_file(self.output / "state.json") as partial:
            partial.write_text(
                json.dumps({"seed": self.seed, "states": states}, indent=1) + "\n", encoding="utf-8"
            )


def _finding(folder: Path, how: str) -> Finding:
    """What a dead worker leaves behind: the innermost lines of ours that the crash handler saw."""
    text = (
        (folder / "crash").read_text(encoding="utf-8", errors="replace")
        if (folder / "crash").exists()
        else ""
    )
    frames = [line.strip() for line in text.splitlines() if line.strip().startswith("File ")]
    ours = [f"{Path(line.split(chr(34))[1]).name}:{line.rpartition(' in ')[2]}" for line in frames][
        :2
    ]
    kind = "hang" if how == "hang" else "crash"
    return Finding(kind, f"{how} {' < '.join(ours)}".strip(), text.splitlines()[0] if text else how)


def _watched(words: list[str], folder: Path, look: Any = None) -> str | None:
    """Runs a worker to its end;

    None, or how it ended otherwise: "hang", or the name of a signal or its exit code.
    """
    (folder / "at").write_bytes(AT.pack(0, -1, 0.0))
    single = dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"),
        "1",
    )
    worker = subprocess.Popen(
        [sys.executable, *WORKER, *words],
        cwd=Path(__file__).resolve().parents[2],
        env={**os.environ, **single, "MALLOC_ARENA_MAX": "1"},
        stdin=subprocess.DEVNULL,
    )
    try:
        before, since = b"", time.monotonic()
        while worker.poll() is None:
            time.sleep(_LOOK)
            if look is not None:
                look()
            now = (folder / "at").read_bytes()
            if now != before:
                before, since = now, time.monotonic()
            _, number, began = AT.unpack(now)
            spent = _processor_seconds(worker.pid) - began
            if spent > (HANG if number >= 0 else _START) or (
                number >= 0 and time.monotonic() - since > _WAIT + HANG
            ):
                worker.send_signal(signal.SIGABRT)  # the crash handler then writes where it was
                worker.wait(10)
                return "hang"
    finally:
        if worker.poll() is None:
            worker.kill()
            worker.wait()
    if worker.returncode == 0:
        return None
    return (
        signal.Signals(-worker.returncode).name
        if worker.returncode < 0
        else f"exit {worker.returncode}"
    )


def _processor_seconds(process: int) -> float:
    try:
        fields = (
            Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        )
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
