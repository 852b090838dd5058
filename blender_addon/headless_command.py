"""The command behind `headless`: each photo is taken apart by a worker, the objects are built,
saved and rendered.

What there is to say of a photo's result, such as why it is doubtful, is printed once all is done. A
photo that fails is named on stderr and the others go on; the exit code is then 2. Files appear
whole or not at all. Ctrl-C ends the worker; during a render it is answered once the render is done.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from isc_core.errors import Cancelled, InputError
from isc_core.terminal import Interrupts, ProgressBar, printable

DONE, REFUSED, CANCELLED = 0, 2, 130


class _Parser(argparse.ArgumentParser):
    """Raises `InputError` instead of printing its usage."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see --help)")


def main(arguments: Sequence[str]) -> int:
    """Runs the command and returns its exit code; never raises for a user's mistake."""
    try:
        options = _parser().parse_args(arguments)
        _require_blender()
        from .headless_batch import run

        with Interrupts() as interrupts, ProgressBar(sys.stderr, quiet=options.quiet) as bar:
            said = run(options, interrupts.monitor(bar))
    except SystemExit as done:  # --help
        return int(done.code or 0)
    except InputError as error:
        return _refuse(error)
    except (Cancelled, KeyboardInterrupt):
        print("blender: cancelled", file=sys.stderr)
        return CANCELLED
    for note in said.notes:
        print(printable(note, sys.stdout))
    for failure in said.failures:
        _refuse(failure)
    return REFUSED if said.failures else DONE


def _require_blender() -> None:
    try:
        import bpy  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"this needs Blender, or its Python module ({error}): pip install 'isc3d[blender]'"
        ) from error


def _refuse(error: InputError | str) -> int:
    print(f"blender: error: {error}", file=sys.stderr)
    return REFUSED


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="blender -b -P headless.py --",
        allow_abbrev=False,
        description="Photos of glossy objects become textured objects in .blend files, under the light that was recovered, and renders.",
    )
    add = parser.add_argument
    add(
        "inputs",
        nargs="+",
        type=Path,
        metavar="PHOTO",
        help="a photo, a folder of photos, or a folder that isc decompose wrote",
    )
    add(
        "--mask",
        type=Path,
        help="the object in white on black, of the photo's size; or a folder where the mask of cup.jpg is cup.*",
    )
    add(
        "-o",
        "--output",
        type=Path,
        metavar="OUT",
        help="a .blend file (several objects: a scene each), or a folder for one file each",
    )
    add(
        "--render",
        type=Path,
        metavar="OUT",
        help="a .png or .exr file to render to with Cycles, or a folder for one file each",
    )
    add("--samples", type=int, default=64, metavar="N", help="rays a pixel (default %(default)s)")
    add(
        "--results",
        type=Path,
        metavar="DIR",
        help="keep the results of the photos here, a folder each",
    )
    add("--quiet", action="store_true", help="show no progress")
    _add_recovery(parser.add_argument_group("how a photo is taken apart"))
    _add_scene(parser.add_argument_group("what is built"))
    return parser


def _add_recovery(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add(
        "--model",
        default="joint",
        metavar="NAME",
        help="as isc decompose knows them (default %(default)s)",
    )
    add(
        "--separator",
        default="isc",
        metavar="NAME",
        help="what removes highlights (default %(default)s)",
    )
    add(
        "--illumination",
        default="natural",
        choices=("natural", "laboratory"),
        help="which lights to expect (default %(default)s)",
    )
    add(
        "--transfer",
        default="auto",
        choices=("auto", "srgb", "linear"),
        help="how the photos are coded (default %(default)s)",
    )
    add(
        "--max-size",
        type=int,
        default=512,
        metavar="N",
        help="long side of the object in the maps, pixels; 0: as is (default %(default)s)",
    )
    add(
        "--threads",
        type=int,
        default=0,
        metavar="N",
        help="0: one for each core (default %(default)s)",
    )


def _add_scene(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add(
        "--size",
        type=float,
        default=0.1,
        metavar="M",
        help="long side of the object in metres (default %(default)s)",
    )
    add(
        "--specular",
        default="image",
        choices=("lobe", "image", "none"),
        help="where highlights come from (default %(default)s)",
    )
    add(
        "--own-shadows",
        action="store_true",
        help="let the object cast shadows on itself, beside those that the recovered light holds",
    )
    add("--sun", action="store_true", help="add a sun from the strongest direction of the light")
    add(
        "--displacement",
        action="store_true",
        help="displace a flat grid instead of building the mesh",
    )
    add("--closed-back", action="store_true", help="close the mesh behind")
