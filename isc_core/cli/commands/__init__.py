"""The sub-commands of `isc`, one per file: each declares its options and runs.

A command's `run(options, monitor)` returns the lines to print; it raises `InputError` and
`Cancelled`.

Packages that build on the core add commands of their own: each is an entry point of the group
`isc.commands` that names a module with `declare(commands)`. One that cannot be imported here stays
in the list and says what to install; the others work all the same.
"""

import argparse
from importlib.metadata import EntryPoint, entry_points
from typing import NoReturn

from ... import __version__
from ...errors import InputError
from ...progress import Monitor
from ..interface.options import Commands, Parser
from . import arrays, batch, decompose, edit, evaluate, fit_priors, mask, separate

_GROUP = "isc.commands"

_EXAMPLES = """examples:
  isc decompose cup.png -o cup                          everything, into the folder cup
  isc mask photo.jpg --box 120,80,400,360 -o mask.png   first mask the object if needed
  isc decompose photo.jpg --mask mask.png -o result
`isc COMMAND --help` shows every option.
Exit codes: 0 done, 1 done with failures, 2 an input cannot be used, 130 cancelled."""


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of `isc`; it sets `run`, the function to call, and `quiet`."""
    parser = Parser(
        prog="isc",
        description="Intrinsic scene characteristics from one photo of a glossy object: diffuse "
        "and specular light, shape, illumination, "
        "shading and reflectance, and a textured mesh.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("--version", action="version", version=f"isc {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in (decompose, batch, separate, edit, arrays, mask, evaluate, fit_priors):
        command.declare(commands)
    for entry in entry_points(group=_GROUP):
        _declare_plugin(entry, commands)
    return parser


def _declare_plugin(entry: EntryPoint, commands: Commands) -> None:
    """Add the command of another package; if that cannot be imported, a command that takes any
    arguments and fails.
    """
    try:
        module = entry.load()
    except ImportError as error:
        extra = entry.module.partition(".")[0]
        reason = (
            f"isc {entry.name} is not available ({error}): install it with "
            f"`pip install 'isc3d[{extra}]'`"
        )
    else:
        module.declare(commands)
        return

    def fail(options: argparse.Namespace, monitor: Monitor) -> NoReturn:
        del options, monitor
        raise InputError(reason)

    # No argument begins with this prefix, so the parser accepts all arguments, options included.
    parser = commands.add_parser(
        entry.name, help="not available: run it to see why", prefix_chars="\0", add_help=False
    )
    parser.add_argument("anything", nargs="*")
    parser.set_defaults(run=fail, quiet=True)
