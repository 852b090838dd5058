"""Options that select the object: --box, --point, --not, --each."""

import argparse

from ...errors import InputError
from ...imaging.bounding_box import mask_slices
from ...masking.components import connected_components
from ...masking.hints import Hints
from ...photo.grabcut import Box
from ...photo.photo import Photo
from .options import add_pixels

Group = argparse._ArgumentGroup


def add_hints(group: Group | argparse.ArgumentParser) -> None:
    """Add --box, --point and --not.

    Parameters
    ----------
    group : argparse._ArgumentGroup
        Changed in place.
    """
    group.add_argument(
        "--box",
        type=_box,
        metavar="x,y,w,h",
        help="box around the object with some background: left, top, width, height in pixels",
    )
    add_pixels(group, "--point", "points", "the object")
    add_pixels(group, "--not", "others", "the background")


def add_each(group: Group | argparse.ArgumentParser, what: str) -> None:
    """Add --each.

    Parameters
    ----------
    group : argparse._ArgumentGroup
        Changed in place.
    what : str
        Names of the outputs, for the help.
    """
    group.add_argument(
        "--each", action="store_true", help=f"process each of several separate objects: {what}"
    )


def hints_of(options: argparse.Namespace) -> Hints:
    """Return the hints of a command line.

    Parameters
    ----------
    options : argparse.Namespace

    Returns
    -------
    Hints

    Raises
    ------
    InputError
        If there is also a mask, or --each.
    """
    hints = Hints(tuple(options.points), tuple(options.others), options.box)
    if hints and getattr(options, "mask", None) is not None:
        raise InputError("--mask already selects the object: leave out --box, --point and --not")
    if hints and getattr(options, "each", False):
        raise InputError("--each processes all objects: leave out --box, --point and --not")
    return hints


def mask_notes(photo: Photo) -> list[str]:
    """Return notes on the mask of a photo.

    Parameters
    ----------
    photo : Photo

    Returns
    -------
    list of str
    """
    notes = []
    if found := how_found(photo):
        notes.append(f"{found}: check mask.png in the result; --box, --point and --not correct it")
    parts = len(connected_components(photo.mask[mask_slices(photo.mask)]))
    if parts > 1:
        notes.append(
            f"the mask has {parts} separate parts, which are treated as one object: use --each to "
            "decompose each of them"
        )
    return notes


def how_found(photo: Photo) -> str:
    """Return how the mask of a photo was found, and its confidence.

    Parameters
    ----------
    photo : Photo

    Returns
    -------
    str
        "" for a given mask, or one without a confidence.
    """
    source = photo.original
    if source.confidence is None:
        return ""
    how = "from your hints" if source.mask_from == "hints" else "automatically"
    return f"the mask was found {how} (confidence {source.confidence:.0%})"


def _box(text: str) -> Box:
    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not four integers x,y,w,h") from error
    return x, y, width, height
