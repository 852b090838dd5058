"""`isc thesis`: the tables and figures of the thesis, regenerated."""

import argparse
import importlib.util
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from isc_core.cli.interface.parser import describe, hints
from isc_core.cli.interface.values import count
from isc_core.errors import InputError, Rejected
from isc_core.extras import install_command
from isc_core.progress import Monitor

if TYPE_CHECKING:
    from .making import MakeSummary
    from .report.item import ThesisItem

_DEFAULT = Path("build") / "thesis"
_PUBLISHED = Path("docs") / "thesis"
_LIBRARIES = ("matplotlib", "skimage")
_DESCRIPTION = (
    "Regenerate the tables and figures of the thesis on open data and compare them with its "
    "claims. Writes Markdown, CSV and PNG files, a picture sheet per chapter and an index."
)
_EXAMPLES = """  isc thesis list
  isc thesis table 4.5 --quick -o results
  isc thesis figure 4.50 -o results
  isc thesis all --data ROOT -o results
  isc thesis publish -o results --to docs/thesis

ROOT is a folder with MIT-Berkeley-Laboratory/ (or mit_berkeley_train/), highlight/ and photos/.
Without --data, the project renders all images itself. An interrupted run resumes."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    describe(
        parser,
        _no_subcommand,
        _DESCRIPTION,
        examples=_EXAMPLES,
    )
    below = parser.add_subparsers(
        title="commands", metavar="list | table N | figure N | all | publish"
    )
    listing = below.add_parser("list", help="list every item and its state", parents=[_common()])
    listing.set_defaults(run=run_list)
    for kind in ("table", "figure"):
        one = below.add_parser(kind, help=f"make one {kind}", parents=[_common()])
        one.add_argument("number", metavar="N", help="number, as in 4.5")
        one.set_defaults(run=run_one, kind=kind)
    everything = below.add_parser("all", help="make every table and figure", parents=[_common()])
    everything.set_defaults(run=run_all)
    publishing = below.add_parser(
        "publish",
        help="copy the index, the pages of the tables and the picture sheets",
        parents=[_output()],
    )
    publishing.add_argument(
        "--to",
        type=Path,
        default=_PUBLISHED,
        metavar="DIR",
        help="folder to write (default: %(default)s)",
    )
    publishing.set_defaults(run=run_publish)


def _output() -> argparse.ArgumentParser:
    """Options of every subcommand."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=_DEFAULT,
        metavar="DIR",
        help="output folder (default: %(default)s)",
    )
    return parser


def _common() -> argparse.ArgumentParser:
    """Options of the subcommands that make items."""
    parser = argparse.ArgumentParser(add_help=False, parents=[_output()])
    parser.add_argument(
        "--data",
        type=Path,
        metavar="ROOT",
        help="folder of public data sets (default: images rendered by the project)",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="small images and few repetitions; takes minutes instead of hours",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=0,
        metavar="S",
        help="random seed (default: %(default)s)",
    )
    parser.add_argument(
        "--again",
        action="store_true",
        help="recompute items and rows that are already complete",
    )
    return parser


def _no_subcommand(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    del options, monitor
    raise InputError(
        "choose a subcommand: isc thesis list, table N, figure N, all or publish "
        "(see `isc thesis --help`)"
    )


def run_list(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """List every item: number, state, title and verdicts.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    monitor : Monitor
        Not used.

    Returns
    -------
    list of str
        Lines to print.

    Raises
    ------
    InputError
        If a library is missing.
    """
    _require_libraries()
    from .making import item_states
    from .registry import all_items

    del monitor
    return list(item_states(all_items(), options.output))


def run_one(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Make one item.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    list of str
        Lines to print.

    Raises
    ------
    InputError
        If the number is unknown or the item cannot be made.
    Cancelled
        If the user cancels.
    """
    _require_libraries()
    from .registry import find_item

    item = find_item(options.kind, options.number)
    if item.make is None:
        raise InputError(f"{item.kind} {item.number} cannot be regenerated: {item.reason}")
    return _summary_lines(options, _make(options, [item], monitor))


def run_all(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Make every item that can be made, and a picture sheet per chapter.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    list of str
        Lines to print.

    Raises
    ------
    InputError
        If data or folders cannot be used.
    Rejected
        If some items cannot be made; the others are complete.
    Cancelled
        If the user cancels.
    """
    _require_libraries()
    from .registry import all_items
    from .report.chapter_sheets import write_chapter_sheets
    from .report.records import read_records

    items, folder = all_items(), options.output
    summary = _make(options, [item for item in items if item.make is not None], monitor)
    write_chapter_sheets(folder, folder, items, read_records(folder, items))
    lines = _summary_lines(options, summary)
    if summary.failed:
        reasons = (f"{name} was not made: {reason}" for name, reason in summary.failed)
        raise Rejected("\n".join(reasons), lines)
    return lines


def run_publish(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Copy the index, the pages of the tables and the picture sheets.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    monitor : Monitor
        Not used.

    Returns
    -------
    list of str
        Lines to print.

    Raises
    ------
    InputError
        If the output folder has no items.
    """
    _require_libraries()
    from .registry import all_items
    from .report.files import publish

    del monitor
    written = publish(options.output, options.to, all_items())
    return hints(options, f"wrote {len(written)} files to {options.to}")


def _require_libraries() -> None:
    """Check for the drawing library and the nine images; Mitsuba is checked where it renders."""
    if missing := [name for name in _LIBRARIES if importlib.util.find_spec(name) is None]:
        raise InputError(
            f"isc thesis needs {' and '.join(missing)}: install with `{install_command('thesis')}`"
        )


def _make(
    options: argparse.Namespace, wanted: "Sequence[ThesisItem]", monitor: Monitor
) -> "MakeSummary":
    from .making import make_items
    from .measuring.context import Context

    context = Context(options.output, options.data, options.quick, options.seed, monitor)
    if options.again:
        context = replace(context, fresh_since=time.time())
    return make_items(wanted, context, again=options.again)


def _summary_lines(options: argparse.Namespace, summary: "MakeSummary") -> list[str]:
    index = options.output / "README.md"
    return hints(options, f"{summary.made} made, {summary.kept} kept; index: {index}")
