"""The command line of `headless`: decompose each photo by a worker, build, save and render the
objects.

Notes on a result, such as assumptions that do not hold, are printed at the end. A photo that fails
is reported on stderr and the others continue; the exit code is then 2. Files are written completely
or not at all. Ctrl-C ends the worker; a render is finished first.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from isc_core.cli.interface.interrupts import Interrupts
from isc_core.cli.interface.terminal import ProgressBar, printable
from isc_core.cli.interface.values import count, positive, texture_size, whole
from isc_core.errors import Cancelled, InputError
from isc_core.extras import install_command

from .worker.commands import CERTAIN

DONE, INVALID_INPUT, CANCELLED = 0, 2, 130


class _Parser(argparse.ArgumentParser):
    """Raises `InputError` instead of printing its usage."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see --help)")


def main(arguments: Sequence[str]) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : sequence of str
        Arguments without the program's name.

    Returns
    -------
    int
        Exit code.
    """
    try:
        options = _parser().parse_args(arguments)
        _require_blender()
        from .headless_batch import run_batch

        with Interrupts() as interrupts, ProgressBar(sys.stderr, quiet=options.quiet) as bar:
            report = run_batch(options, interrupts.monitor(bar))
    except SystemExit as done:  # --help
        return int(done.code or 0)
    except InputError as error:
        return _print_error(error)
    except (Cancelled, KeyboardInterrupt):
        print("blender: cancelled", file=sys.stderr)
        return CANCELLED
    for note in report.notes:
        print(printable(note, sys.stdout))
    for failure in report.failures:
        _print_error(failure)
    return INVALID_INPUT if report.failures else DONE


def _require_blender() -> None:
    try:
        import bpy  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"Blender or its Python module is missing ({error}): install the module with "
            f"`{install_command('blender')}`"
        ) from error


def _print_error(error: InputError | str) -> int:
    print(f"blender: error: {error}", file=sys.stderr)
    return INVALID_INPUT


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="blender -b -P headless.py --",
        allow_abbrev=False,
        description=(
            "Turn photos of glossy objects into textured objects in .blend files, under the "
            "recovered light, and render them."
        ),
    )
    parser.add_argument(
        "inputs",
        nargs="+",
        type=Path,
        metavar="PHOTO",
        help="photo, folder of photos, or result folder of isc decompose",
    )
    parser.add_argument("--quiet", action="store_true", help="hide progress")
    _add_files(parser.add_argument_group("files"))
    _add_method(parser.add_argument_group("decomposition"))
    _add_build(parser.add_argument_group("scene"))
    return parser


def _add_files(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add(
        "--mask",
        type=Path,
        help=(
            "mask of the photo's size with the object white on black, or a folder with the mask "
            "of cup.jpg in cup.*"
        ),
    )
    add(
        "--each",
        action="store_true",
        help="create a Blender object for each separate object in a photo, in one scene",
    )
    add(
        "-o",
        "--output",
        type=Path,
        metavar="OUT",
        help=".blend file (a scene for each of several objects), or folder for one file each",
    )
    add(
        "--render",
        type=Path,
        metavar="OUT",
        help=".png or .exr file to render to with Cycles, or folder for one file each",
    )
    add(
        "--samples",
        type=whole,
        default=64,
        metavar="N",
        help="samples per pixel (default: %(default)s)",
    )
    add(
        "--results",
        type=Path,
        metavar="DIR",
        help="folder in which to keep the result folders",
    )


def _add_method(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add(
        "--model",
        default="joint",
        metavar="NAME",
        help="model, as in isc decompose (default: %(default)s)",
    )
    add(
        "--separator",
        default="isc",
        metavar="NAME",
        help="method that removes highlights, as in isc decompose (default: %(default)s)",
    )
    add(
        "--illumination",
        default="photo",
        choices=("photo", "natural", "laboratory"),
        help="kind of photo, as in isc decompose (default: %(default)s)",
    )
    add(
        "--light-colour",
        default="balanced",
        metavar="NAME|r,g,b",
        help="colour of the light, as in isc decompose (default: %(default)s)",
    )
    add(
        "--camera",
        default="auto",
        metavar="NAME|MM",
        help="camera, as in isc decompose (default: %(default)s)",
    )
    add(
        "--transfer",
        default="auto",
        choices=("auto", "srgb", "linear"),
        help="transfer curve of the photos (default: %(default)s)",
    )
    add(
        "--max-size",
        type=count,
        default=512,
        metavar="N",
        help=(
            "longer side of the object in pixels; 0 keeps the photo's resolution "
            "(default: %(default)s)"
        ),
    )
    add(
        "--texture-size",
        type=_texture_size,
        default="photo",
        metavar="photo|maps|N",
        help=(
            "longest side of the base color texture: that of the photo, that of the maps, or at "
            "most N pixels (default: %(default)s)"
        ),
    )
    add(
        "--highlight-odds",
        default=CERTAIN,
        choices=(CERTAIN, "1", "0"),
        help="highlights to remove: certain, likely or all, as in isc decompose "
        "(default: %(default)s)",
    )
    add(
        "--refine",
        action="store_true",
        help="fit lamps and gloss to the highlights, as isc decompose --refine does",
    )
    add(
        "--threads",
        type=count,
        default=0,
        metavar="N",
        help="number of threads; 0 uses one per core (default: %(default)s)",
    )


def _add_build(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add(
        "--size",
        type=positive,
        default=0.1,
        metavar="M",
        help="longer side of the object in metres (default: %(default)s)",
    )
    add(
        "--specular",
        default="lobe",
        choices=("lobe", "image", "none"),
        help="source of the highlights (default: %(default)s)",
    )
    add(
        "--own-shadows",
        action="store_true",
        help="cast shadows on the object itself, in addition to those of the recovered light",
    )
    add("--sun", action="store_true", help="use a sun along the dominant direction of the light")
    add(
        "--displacement",
        action="store_true",
        help="displace a flat grid instead of building the mesh",
    )
    add(
        "--back",
        default="rounded",
        choices=("open", "flat", "rounded", "mirrored"),
        help="shape of the side that the photo does not show (default: %(default)s)",
    )
    add(
        "--triangles",
        type=count,
        default=50_000,
        metavar="N",
        help="maximum number of triangles of the visible side; 0 keeps two for each pixel "
        "(default: %(default)s)",
    )


def _texture_size(text: str) -> str:
    """The text, which is handed on to `isc decompose`, if it is a size."""
    texture_size(text)
    return text
