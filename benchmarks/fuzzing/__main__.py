"""The fuzzing campaign: tens of thousands of damaged files for every reader.

    python -m benchmarks.fuzzing [--readers png,exr] [--inputs 20000] [--seed 0] -o DIR

Goes on where an earlier call stopped. Exits with 1 where anything was found. Linux only: limits and
sums come from the kernel there.
"""

import argparse
import sys
from pathlib import Path

from isc_core.commands.options import names, whole
from isc_core.errors import InputError

from .campaign import Campaign, State
from .targets import TARGETS


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.fuzzing",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--readers",
        type=names,
        default=tuple(TARGETS),
        metavar="NAMES",
        help=f"of {', '.join(TARGETS)} (default: all)",
    )
    parser.add_argument(
        "--inputs",
        type=whole,
        default=20_000,
        metavar="N",
        help="for each reader (default %(default)s)",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the damage (default %(default)s)")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DIR",
        help="where findings go, and how far it is",
    )
    options = parser.parse_args()
    try:
        campaign = Campaign.opened(options.output, options.readers, options.seed, options.inputs)
    except InputError as error:
        print(f"benchmarks.fuzzing: error: {error}", file=sys.stderr)
        return 2
    campaign.run(options.readers)
    print(table({name: campaign.states[name] for name in options.readers}))
    return 1 if any(campaign.states[name].findings for name in options.readers) else 0


def table(states: dict[str, State]) -> str:
    """The campaign's figures in Markdown."""
    lines = [
        "| reader | inputs | refused | most memory | time an input | findings |",
        "|---|---|---|---|---|---|",
    ]
    for name, state in states.items():
        share, each = (
            total / max(state.done, 1) for total in (100 * state.refused, 1000 * state.seconds)
        )
        lines.append(
            f"| {name} | {state.done} | {share:.0f} % | {state.most / 1e6:.0f} MB | {each:.1f} ms | {len(state.findings)} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
