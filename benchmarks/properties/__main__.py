"""Tries every law on many drawn cases, and prints a Markdown table of what was found.

  nice python -m benchmarks.properties -o DIR                      10,000 cases of each cheap law,
  fewer of dear ones python -m benchmarks.properties --examples 500 --laws separation -o DIR

DIR/chunks.jsonl keeps what was run: the same command goes on after it was stopped, a larger
--examples adds cases. Exit 1 if a law fails.
"""

import argparse
import sys
from pathlib import Path

from .registry import LAWS
from .runner import run, table


def main() -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument(
        "--examples",
        type=int,
        default=10_000,
        metavar="N",
        help="cases of each law (default %(default)s)",
    )
    parser.add_argument(
        "--laws", default="", metavar="WORD", help="only those whose name holds this word"
    )
    given = parser.parse_args()
    laws = [law for law in LAWS if given.laws in law.name]
    outcomes = [
        outcome
        for outcome in run(laws, given.examples, given.output)
        if outcome.law in {law.name for law in laws}
    ]
    text = table(laws, outcomes)
    (given.output / "table.md").write_text(text + "\n", encoding="utf-8")
    print(text)
    return 1 if any(outcome.failure for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
