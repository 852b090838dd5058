"""`isc mask`: segmentation of the object inside a box."""

import argparse
from pathlib import Path

from ...photo.grabcut import Box, cut_out
from ...progress import Monitor
from ..interface.options import add_limits, add_photo, add_transfer, limits_of
from ..interface.parser import describe, hints
from ..interface.standard_input import photo_file

_EXAMPLES = """  isc mask photo.jpg --box 120,80,400,360 -o mask.png"""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    describe(
        parser,
        run,
        "Finds the object inside a box and writes its mask, white on black. Check it before you "
        "use it: the segmentation uses colours alone.",
        examples=_EXAMPLES,
    )
    add_photo(parser)
    parser.add_argument(
        "--box",
        type=_box,
        required=True,
        metavar="x,y,w,h",
        help="left, top, width and height in pixels, with some background around the object",
    )
    add_transfer(parser)
    add_limits(parser)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="MASK", help="the PNG file to write"
    )


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command.

    Parameters
    ----------
    options : argparse.Namespace
    monitor : Monitor

    Returns
    -------
    list of str
        Lines to print.
    """
    del monitor  # one step of a second or two
    with photo_file(options.photo, options) as file:
        mask = cut_out(file, options.box, options.output, options.transfer, limits_of(options))
    return hints(options, f"{options.output}: {int(mask.sum())} pixels; check it before you use it")


def _box(text: str) -> Box:
    parts = text.split(",")
    try:
        x, y, width, height = (int(part) for part in parts)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not four integers x,y,w,h") from error
    return x, y, width, height
