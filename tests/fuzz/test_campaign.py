"""A short campaign over all readers, and that a campaign finds what is there to be found."""

import random
from pathlib import Path

import pytest

from benchmarks.fuzzing import campaign, targets
from benchmarks.fuzzing.__main__ import table
from benchmarks.fuzzing.attempt import Finding, case_and_data, minimised
from benchmarks.fuzzing.campaign import Campaign
from benchmarks.fuzzing.case import Case, Target
from benchmarks.fuzzing.mutation import mutated
from isc_core.errors import InputError

linux = pytest.mark.skipif(
    not Path("/proc/self/clear_refs").exists(), reason="limits and sums come from Linux' kernel"
)
INPUTS = 250


@linux
def test_no_reader_lets_anything_but_its_own_error_out(tmp_path: Path) -> None:
    names = list(targets.TARGETS)
    found = Campaign.opened(tmp_path, names, seed=1, inputs=INPUTS)
    found.run(names)
    told = {
        path.parent.name: path.read_text(encoding="utf-8")
        for path in tmp_path.glob("*/finding.json")
    }
    assert not told, "\n".join(told.values())
    for name, state in found.states.items():
        assert state.done == INPUTS
        assert INPUTS * 0.2 < state.refused < INPUTS, (
            f"{name}: the damage is too small or too large to say anything"
        )
        assert state.most < 2 << 30
    assert table(found.states).count("\n") == len(names) + 1


@linux
def test_a_campaign_goes_on_where_it_stopped(tmp_path: Path) -> None:
    one = Campaign.opened(tmp_path, ["stl"], seed=1, inputs=20)
    one.run(["stl"])
    before = one.states["stl"]
    more = Campaign.opened(tmp_path, ["stl"], seed=1, inputs=40)
    assert more.states["stl"] == before
    more.run(["stl"])
    assert more.states["stl"].done == 40
    with pytest.raises(InputError, match="seed 1"):
        Campaign.opened(tmp_path, ["stl"], seed=2, inputs=40)
    with pytest.raises(InputError, match="unknown reader"):
        Campaign.opened(tmp_path, ["gif"], seed=1, inputs=40)


SOUND = b"fine and whole" * 4
FAULTY = """'A worker whose only reader is faulty.'

import os
import sys
import types

sys.path.insert(0, os.getcwd())
kind = sys.argv.pop(1)
targets = types.ModuleType("targets")
sys.modules["benchmarks.fuzzing.targets"] = targets  # the sound ones take a second to load
from benchmarks.fuzzing import worker
from benchmarks.fuzzing.case import Case, Target

SOUND = b"fine and whole" * 4


def read(path):
    if path.read_bytes() == SOUND:
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


targets.TARGETS = {"faulty": Target("faulty", lambda: (Case("a.bin", SOUND, read),))}
worker.main()
"""


@linux
@pytest.mark.parametrize("kind", ["exception", "noise", "memory", "crash", "hang"])
def test_a_campaign_finds_every_kind_of_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    script = tmp_path / "faulty.py"
    script.write_text(FAULTY, encoding="utf-8")
    known = {"faulty": Target("faulty", lambda: (Case("a.bin", SOUND, Path.read_bytes),))}
    for name, value in {
        "TARGETS": known,
        "WORKER": (str(script), kind),
        "HANG": 0.3,
        "_TRIES": 2,
    }.items():
        monkeypatch.setattr(campaign, name, value)
    run = Campaign.opened(tmp_path / "out", ["faulty"], seed=0, inputs=2)
    run.run(["faulty"])
    assert run.states["faulty"].done == 2
    assert {name.split("-")[1] for name in run.states["faulty"].findings} == {kind}
    (folder,) = (path.parent for path in tmp_path.glob("out/*/finding.json"))
    assert len((folder / "small-a.bin").read_bytes()) < len(SOUND)


def test_damage_hangs_on_its_number_alone() -> None:
    target = targets.TARGETS["ply"]
    cases = target.cases()
    one, other = (case_and_data(target, cases, 3, 17) for _ in range(2))
    assert one[1] == other[1]
    assert case_and_data(target, cases, 4, 17)[1] != one[1]


def test_damage_changes_much_and_stays_small() -> None:
    data = bytes(range(256)) * 4
    made = [mutated(random.Random(k), data, [data[::-1]], [b"word"]) for k in range(500)]
    assert len(set(made)) > 450
    assert max(len(one) for one in made) <= 1 << 18
    assert mutated(random.Random(1), b"", [], []) is not None


def test_minimising_keeps_the_finding() -> None:
    found = Finding("exception", "somewhere", "")
    small = minimised(
        b"abcXdefgh" * 5, found, lambda data: found if b"X" in data else None, tries=1000
    )
    assert small == b"X"
    assert minimised(b"a" * 10_000, found, lambda data: None, tries=5) == b"a" * 10_000
