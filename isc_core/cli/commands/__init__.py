"""The sub-commands of `isc`, one per file; `registry` lists them, this module builds the parser."""

import argparse
import importlib
from collections.abc import Sequence
from typing import NoReturn

from ... import __version__
from ...errors import InputError
from ...progress import Monitor
from ..interface.parser import EXIT_CODES, Parser, add_general_options
from .registry import CommandEntry, all_commands, find_command

_EXAMPLES = """examples:
  isc decompose cup.png -o cup                          everything, into the folder cup
  isc mask photo.jpg --box 120,80,400,360 -o mask.png   mask the object first if needed
  isc decompose photo.jpg --mask mask.png -o result
`isc COMMAND --help` shows the options of a command."""


def build_parser(arguments: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Build the parser of `isc`; it sets `run`, the function to call, and the general options.

    Parameters
    ----------
    arguments : sequence of str, optional
        The arguments to parse: only their command is imported. By default all are.

    Returns
    -------
    argparse.ArgumentParser
    """
    parser = Parser(
        prog="isc",
        description="Intrinsic scene characteristics from one photo of a glossy object: diffuse "
        "and specular light, shape, illumination, "
        "shading and reflectance, and a textured mesh.",
        epilog=f"{_EXAMPLES}\n\n{EXIT_CODES}",
    )
    parser.add_argument("-h", "--help", action="help", help="show this help and exit")
    parser.add_argument("--version", action="version", version=f"isc {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    chosen = next((word for word in arguments or () if not word.startswith("-")), "")
    entry = find_command(chosen)
    for known in all_commands() if entry is None else (entry,):
        added = commands.add_parser(known.name, help=known.summary)
        if known is entry or arguments is None:
            _declare(added, known)
    return parser


def _declare(parser: argparse.ArgumentParser, entry: CommandEntry) -> None:
    """Add the options of a command; if it cannot be imported, a `run` that reports the reason."""
    try:
        module = importlib.import_module(entry.module)
    except ImportError as error:
        if (error.name or "").startswith(f"{entry.module.partition('.')[0]}."):
            raise  # the package is installed but lacks a module: a defect
        _declare_unavailable(parser, entry, error)
    else:
        module.declare(parser)
        add_general_options(parser)


def _declare_unavailable(
    parser: argparse.ArgumentParser, entry: CommandEntry, error: ImportError
) -> None:
    from ...extras import install_command

    advice = f": install it with `{install_command(entry.extra)}`" if entry.extra else ""
    reason = f"isc {entry.name} is not available ({error}){advice}"

    def fail(options: argparse.Namespace, monitor: Monitor) -> NoReturn:
        del options, monitor
        raise InputError(reason)

    # No argument begins with this prefix, so that the parser accepts any.
    parser.prefix_chars = "\0"
    parser.add_argument("anything", nargs="*")
    parser.set_defaults(run=fail, quiet=True, verbose=False, config=None, no_config=True)
