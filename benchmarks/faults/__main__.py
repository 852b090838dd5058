"""Makes disks, files, clocks and processes fail under the commands, and prints a Markdown table of
what became of their outputs.

  nice python -m benchmarks.faults -o DIR [--kills 100] [--only WORD]

DIR/rows.jsonl keeps what was run: the same command goes on after it was stopped. What needs rights
that this user lacks is skipped, and the table says so. Exit 1 if an output was wrong. On Linux.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from ..records import append_row, read_rows
from .commands import COMMANDS, Command, prepared
from .disk import FAULTS, Faults, reference
from .listing import many_images
from .processes import at_once, changing, kill, wrong_clock

Row = dict[str, Any]
Digests = dict[str, str]
Work = Callable[[], Row]


def main() -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument(
        "--kills",
        type=int,
        default=100,
        metavar="N",
        help="processes killed, over all commands (default %(default)s)",
    )
    parser.add_argument(
        "--only", default="", metavar="WORD", help="only faults whose name holds this word"
    )
    given = parser.parse_args()
    folder = given.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "rows.jsonl"
    rows = read_rows(path)
    known = {str(row["key"]) for row in rows}
    for key, work in _works(folder, given.kills):
        if key in known or given.only not in key:
            continue
        row = {"key": key, **work()}
        rows.append(row)
        append_row(path, row)
        print(
            f"{key}: {row['runs']} runs, {len(row['wrong'])} wrong {row['wrong'][:2] or row['note']}",
            flush=True,
        )
    text = table(rows)
    (folder / "table.md").write_text(text + "\n", encoding="utf-8")
    print(text)
    return 1 if any(row["wrong"] for row in rows) else 0


def _row(found: list[str] | None, note: str = "") -> Row:
    if found is None:
        return {"runs": 0, "wrong": [], "note": "skipped: needs the right to mount"}
    return {"runs": len(found), "wrong": [trouble for trouble in found if trouble], "note": note}


def _works(folder: Path, kills: int) -> Iterator[tuple[str, Work]]:
    """What is to be done, by keys; each makes its own place below `folder`."""
    inputs, place = prepared(folder), folder / "place"
    whole: dict[str, dict[str, str]] = {}

    def of(command: Command) -> dict[str, str]:
        if command.name not in whole:
            whole[command.name] = reference(command, inputs, folder / "whole" / command.name)
        return whole[command.name]

    for number in range(kills):
        command = COMMANDS[number % len(COMMANDS)]
        yield (
            f"kill -9 | {command.name} | {number}",
            partial(_killed, command, inputs, place, of, number),
        )
    for command in COMMANDS:
        yield (
            f"two runs into one folder | {command.name}",
            partial(_repeated, at_once, command, inputs, place, of),
        )
    for kind in ("png", "exr", "npy"):
        yield (
            f"a photo that changes while it is read | {kind}",
            partial(_changing, inputs, place, kind),
        )
    for command in COMMANDS:
        yield (
            f"the clock goes back | {command.name}",
            partial(_repeated, wrong_clock, command, inputs, place, of),
        )
    yield "10,000 images in one folder | batch", lambda: _row(*many_images(place, 10_000))
    for name, fault in FAULTS.items():
        for command in COMMANDS[::-1]:
            yield (
                f"{name} | {command.name}",
                partial(_with_output, fault, command, inputs, place, of),
            )


def _killed(
    command: Command, inputs: Path, place: Path, of: Callable[[Command], Digests], number: int
) -> Row:
    return _row([kill(command, inputs, place, of(command), number)])


def _repeated(
    fault: Callable[..., str],
    command: Command,
    inputs: Path,
    place: Path,
    of: Callable[[Command], Digests],
) -> Row:
    return _row([fault(command, inputs, place, of(command), number) for number in range(4)])


def _with_output(
    fault: Faults, command: Command, inputs: Path, place: Path, of: Callable[[Command], Digests]
) -> Row:
    whole = of(command)
    reference(command, inputs, place)
    return _row(fault(command, inputs, place, whole))


def _changing(inputs: Path, place: Path, kind: str) -> Row:
    read_well, refused, wrong = changing(inputs, place, kind, 30.0)
    return {
        "runs": read_well + refused,
        "wrong": wrong,
        "note": f"{read_well} read whole, {refused} refused in one line",
    }


def table(rows: list[Row]) -> str:
    """Markdown: a line for each fault and command; kills of a command together."""
    merged: dict[tuple[str, str], Row] = {}
    for row in rows:
        fault, command = str(row["key"]).split(" | ")[:2]
        one = merged.setdefault((fault, command), {"runs": 0, "wrong": [], "note": row["note"]})
        one["runs"] = int(one["runs"]) + int(row["runs"])
        one["wrong"] = [*one["wrong"], *row["wrong"]]
    lines = ["| fault | command | runs | wrong outputs | remark |", "|---|---|---:|---:|---|"]
    for (fault, command), row in merged.items():
        lines.append(
            f"| {fault} | {command} | {row['runs']} | {len(row['wrong'])} | {row['note']} |"
        )
    troubles = [f"- {row['key']}: {trouble}" for row in rows for trouble in row["wrong"]]
    return "\n".join([*lines, "", *(troubles or ["No output was wrong."])])


if __name__ == "__main__":
    sys.exit(main())
