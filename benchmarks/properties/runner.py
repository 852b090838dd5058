"""Runs laws on drawn cases in chunks, each of them kept, so that a long run can be stopped and goes
on.
"""

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import seed as seeded

from ..records import append_row, read_rows
from .law import Law, Notes

CHUNK = 200
# What a law may find; anything else, as an interrupt, ends the run.
_FINDINGS = (
    AssertionError,
    Warning,
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    ExceptionGroup,
)
_PHASES = (Phase.generate, Phase.target, Phase.shrink)


@dataclass(frozen=True)
class Outcome:
    """What a chunk of `examples` cases of a law found.

    `failure`: "" or the smallest case that fails, and why.
    """

    law: str
    chunk: int
    examples: int
    refused: int
    seconds: float
    failure: str = ""
    measured: dict[str, float] = field(default_factory=dict)


def run_chunk(law: Law, chunk: int, examples: int) -> Outcome:
    """Tries `law` on drawn cases; the same `chunk` draws the same ones."""
    notes, tried, start = Notes(), Counter[str](), time.monotonic()

    @seeded(chunk)
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        phases=_PHASES,
        suppress_health_check=list(HealthCheck),
    )
    @given(law.cases)
    def holds(case: object) -> None:
        tried["cases"] += 1
        smallest[0] = repr(case)
        law.try_on(case, notes)

    smallest, failure = [""], ""
    try:
        holds()
    except _FINDINGS as error:
        several = error.exceptions if isinstance(error, ExceptionGroup) else (error,)
        said = "; ".join(
            f"{type(one).__name__}: {' '.join(str(one).split())}"[:300] for one in several
        )
        failure = f"{smallest[0]}: {said}"
    return Outcome(
        law.name,
        chunk,
        tried["cases"],
        notes.refused,
        round(time.monotonic() - start, 2),
        failure,
        notes.measured,
    )


def run(laws: Sequence[Law], examples: int, folder: Path) -> list[Outcome]:
    """As many cases of each law, in turns of a chunk; what `folder` holds already is not run again.
    Cheap laws get all of them, a law that costs more than .05 s a case proportionally fewer.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "chunks.jsonl"
    done = [Outcome(**row) for row in read_rows(path)]
    known = {(outcome.law, outcome.chunk) for outcome in done}
    wanted = {law.name: max(20, round(examples * min(1.0, 0.05 / law.cost))) for law in laws}
    for chunk in range(-(-max(wanted.values()) // CHUNK)):
        for law in laws:
            left = min(CHUNK, wanted[law.name] - chunk * CHUNK)
            if left <= 0 or (law.name, chunk) in known:
                continue
            outcome = run_chunk(law, chunk, left)
            done.append(outcome)
            append_row(path, asdict(outcome))
            print(
                f"{law.name}, chunk {chunk}: {outcome.examples} cases, {outcome.seconds:.0f} s {outcome.failure}",
                flush=True,
            )
    return done


def table(laws: Sequence[Law], outcomes: Sequence[Outcome]) -> str:
    """Markdown: a line for each law, then what was measured, then what failed."""
    lines = ["| law | says | cases | refused in one line | failures |", "|---|---|---:|---:|---:|"]
    for law in laws:
        mine = [outcome for outcome in outcomes if outcome.law == law.name]
        cases, refused = sum(o.examples for o in mine), sum(o.refused for o in mine)
        lines.append(
            f"| {law.name} | {law.says} | {cases} | {refused} | {sum(bool(o.failure) for o in mine)} |"
        )
    worst: dict[str, float] = {}
    for outcome in outcomes:
        for name, value in outcome.measured.items():
            worst[f"{outcome.law}: {name}"] = max(value, worst.get(f"{outcome.law}: {name}", 0.0))
    lines += [
        "",
        "| measured | largest |",
        "|---|---:|",
        *(f"| {name} | {value:.3g} |" for name, value in sorted(worst.items())),
    ]
    failures = [f"- {o.law}, chunk {o.chunk}: {o.failure}" for o in outcomes if o.failure]
    return "\n".join([*lines, "", *(failures or ["No law failed."])])
