"""The sub-commands of `isc`, one a file: each declares its options and does its work.

A command's `run(options, monitor)` returns the lines to print; it raises `InputError` and `Cancelled`.
"""

import argparse

from .. import __version__
from . import decompose, evaluate, fit_priors, mask, separate
from .options import Parser

_EXAMPLES = """examples:
  isc decompose cup.png -o cup                          everything, into the folder cup
  isc mask photo.jpg --box 120,80,400,360 -o mask.png   first cut the object out, where the background is not black
  isc decompose photo.jpg --mask mask.png -o result
`isc COMMAND --help` shows every option. Exit code: 0 done, 2 something cannot be used, 130 cancelled."""


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command; what it parses has `run`, to be called, and `quiet`."""
    parser = Parser(
        prog="isc",
        description="Intrinsic scene characteristics from one photo of a glossy object: diffuse and specular light, shape, illumination, "
        "shading and reflectance, and a textured mesh.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("--version", action="version", version=f"isc {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in (decompose, separate, mask, evaluate, fit_priors):
        command.declare(commands)
    return parser
