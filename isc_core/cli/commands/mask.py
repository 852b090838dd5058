"""`isc mask`: the mask of the object in a photo."""

import argparse
from pathlib import Path

from ...errors import InputError
from ...masking.finder import MaskSearch, read_each_object
from ...masking.hints import Hints
from ...photo.grabcut import check_mask_path, write_mask
from ...photo.mask_overlay import write_mask_overlay
from ...photo.photo import Photo
from ...photo.reading import read_photo
from ...progress import Monitor
from ..interface.mask_options import add_each, add_hints, hints_of
from ..interface.options import add_limits, add_photo, add_transfer, limits_of
from ..interface.parser import describe, hints
from ..interface.standard_input import photo_file

_SOURCES = {
    "alpha": "from the alpha channel",
    "black border": "all pixels that are not black",
    "each": "one object",
    "file": "part of a mask",
}
_EXAMPLES = """  isc mask photo.jpg --auto -o mask.png
  isc mask photo.jpg --point 240,310 --not 90,400 -o mask.png
  isc mask photo.jpg --box 120,80,400,360 -o mask.png
  isc mask shelf.jpg --each -o mask.png              mask_1.png, mask_2.png and so on

--auto refuses a photo without one distinct object; --point and --box select the object."""


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
        "Find the object in a photo and write its mask, white on black. Check the mask before you "
        "use it.",
        examples=_EXAMPLES,
    )
    add_photo(parser)
    parser.add_argument("--auto", action="store_true", help="find the object by its appearance")
    add_hints(parser)
    add_each(parser, "MASK_1.png, MASK_2.png and so on")
    parser.add_argument(
        "--overlay",
        type=Path,
        metavar="PNG",
        help="also write a small picture of the photo with the mask overlaid",
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

    Raises
    ------
    InputError
        If no option selects the object.
    """
    del monitor  # one step of a second or two
    given = hints_of(options)
    if not (given or options.auto or options.each):
        raise InputError(
            "no object is selected: find it with --auto, or select it with "
            "--box x,y,width,height or --point x,y"
        )
    check_mask_path(options.photo, options.output)
    if options.overlay is not None:
        if options.each:
            raise InputError("--overlay shows one mask: leave out --each")
        check_mask_path(options.photo, options.overlay)
        if options.overlay.resolve() == options.output.resolve():
            raise InputError(f"--overlay {options.overlay} is the mask itself: choose another file")
    with photo_file(options.photo, options) as file:
        lines = _each(file, options) if options.each else _one(file, given, options)
    return hints(options, *lines)


def _one(file: Path, given: Hints, options: argparse.Namespace) -> list[str]:
    """Write one mask, and return the line to print."""
    limits, finder = limits_of(options), MaskSearch(given)
    photo = read_photo(file, None, options.transfer, limits=limits, finder=finder)
    line = _write(photo, options.output)
    if options.overlay is not None:
        write_mask_overlay(options.overlay, photo)
    return [line]


def _each(file: Path, options: argparse.Namespace) -> list[str]:
    photos = read_each_object(file, None, options.transfer, limits_of(options))
    output: Path = options.output
    paths = [
        output.with_name(f"{output.stem}_{number}{output.suffix}")
        for number in range(1, len(photos) + 1)
    ]
    for path in paths:  # all of them before the first is written
        check_mask_path(options.photo, path)
    return [_write(photo, path) for photo, path in zip(photos, paths, strict=True)]


def _write(photo: Photo, path: Path) -> str:
    """Write the mask of a photo; return the line to print."""
    write_mask(path, photo.mask if photo.cover is None else photo.cover)
    pixels, source = int(photo.mask.sum()), photo.original
    if source.confidence is None:
        found = _SOURCES[source.mask_from]
    else:
        found = f"confidence {source.confidence:.0%}"
    return f"{path}: {pixels} pixels, {found}; check it before you use it"
