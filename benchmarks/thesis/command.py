"""`isc thesis`: the thesis' tables and figures, made again."""

import argparse
import importlib.util
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from isc_core.cli.interface.options import Commands, add_command, add_speech, count, hints
from isc_core.errors import InputError
from isc_core.progress import Monitor

if TYPE_CHECKING:
    pass

_DEFAULT = Path("docs") / "thesis"
_LIBRARIES = ("matplotlib", "skimage")
_EXAMPLES = """  isc thesis list
  isc thesis table 4.5 --quick -o results
  isc thesis figure 4.50 -o results
  isc thesis all --data ROOT -o results     ROOT: a folder with MIT-Berkeley-Laboratory/ (or mit_berkeley_train/), highlight/, photos/

Without --data everything is made on images that the project renders itself. An interrupted run goes on where it stopped."""


def declare(commands: Commands) -> None:
    """Adds the command, and those below it, to the parser."""
    parser = add_command(
        commands,
        "thesis",
        _nothing,
        "the thesis' tables and figures, made again",
        "Makes the tables and figures of the thesis again on open data, beside what it claims: Markdown, CSV and PNG files with an index.",
        _EXAMPLES,
    )
    below = parser.add_subparsers(title="commands", metavar="list | table N | figure N | all")
    listing = below.add_parser(
        "list", help="every table and figure, and what is made of it", parents=[_common()]
    )
    listing.set_defaults(run=run_list)
    for kind in ("table", "figure"):
        one = below.add_parser(kind, help=f"one {kind}", parents=[_common()])
        one.add_argument("number", metavar="N", help="its number, as in 4.5")
        one.set_defaults(run=run_one, kind=kind)
    everything = below.add_parser("all", help="every table and figure", parents=[_common()])
    everything.set_defaults(run=run_all)


def _common() -> argparse.ArgumentParser:
    """The options that all of them have."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=_DEFAULT,
        metavar="DIR",
        help="the folder to write (default: %(default)s)",
    )
    parser.add_argument(
        "--data",
        type=Path,
        metavar="ROOT",
        help="a folder of public data sets (default: the project's own rendered images)",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="small images and few repetitions: minutes instead of hours",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=0,
        metavar="S",
        help="of all random numbers (default: %(default)s)",
    )
    parser.add_argument(
        "--again",
        action="store_true",
        help="make what is complete once more, and compute kept rows anew",
    )
    add_speech(parser)
    return parser


def _nothing(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    del options, monitor
    raise InputError(
        "say what to make: isc thesis list, table N, figure N or all (see `isc thesis --help`)"
    )


def run_list(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """A line for each item: number, title, state, claims.

    Raises `InputError` where a library is missing.
    """
    _require_libraries()
    from .making import item_states
    from .registry import all_items

    del monitor
    return list(item_states(all_items(), options.output))


def run_one(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Makes one item.

    Raises `InputError` for an unknown number and what cannot be made; `Cancelled`.
    """
    _require_libraries()
    from .registry import find_item

    item = find_item(options.kind, options.number)
    if item.make is None:
        raise InputError(f"{item.kind} {item.number} cannot be made again: {item.reason}")
    return _made(options, [item], monitor)


def run_all(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Makes all items that can be made.

    Raises `InputError` for data and folders that cannot be used; `Cancelled`.
    """
    _require_libraries()
    from .registry import all_items

    return _made(options, [item for item in all_items() if item.make is not None], monitor)


def _require_libraries() -> None:
    """What draws and what brings the nine images;

    Mitsuba is asked for where something has to be rendered.
    """
    if missing := [name for name in _LIBRARIES if importlib.util.find_spec(name) is None]:
        raise InputError(
            f"isc thesis needs {' and '.join(missing)}: install them with `pip install 'isc3d[thesis]'`"
        )


def _made(options: argparse.Namespace, wanted: "Sequence[Item]", monitor: Monitor) -> list[str]:
    from .making import make_items
    from .measuring.context import Context

    context = Context(options.output, options.data, options.quick, options.seed, monitor)
    if options.again:
        context = replace(context, fresh_since=time.time())
    outcome = make_items(wanted, context, again=options.again)
    lines = [
        f"{outcome.made} made, {outcome.kept} were complete already: {options.output / 'README.md'} lists them"
    ]
    return hints(
        options, *lines, *(f"not made: {name}: {reason}" for name, reason in outcome.failed)
    )
