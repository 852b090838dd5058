"""Options shared by the actions, and their types."""

import argparse
import sys
from pathlib import Path

import numpy as np

from ....errors import InputError
from ....imaging.srgb import srgb_to_linear
from ....io.printable_names import readable
from ....photo import TRANSFERS
from ....shading.lobe_rendering import DEFAULT_EXPONENT, Lobe
from ...interface.options import add_limits, add_output
from ...interface.values import finite


def add_common(parser: argparse.ArgumentParser) -> None:
    """Add the options of every action: the photo and the output.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    photo = parser.add_argument_group("the photo")
    photo.add_argument(
        "--photo",
        type=Path,
        metavar="PHOTO",
        help="the photo that was decomposed: the edit is applied to it",
    )
    photo.add_argument(
        "--mask",
        type=Path,
        metavar="MASK",
        help="the mask that it was decomposed with (default: mask.png of the result)",
    )
    photo.add_argument(
        "--transfer",
        choices=TRANSFERS,
        help="transfer curve of the photo (default: as isc decompose read it)",
    )
    add_limits(photo)
    add_output(
        parser.add_argument_group("output"), "the folder to write; an earlier edit is replaced"
    )
    parser.set_defaults(usual=vars(parser.parse_args(["-o", "."])))


def add_lobe(parser: argparse.ArgumentParser) -> None:
    """Add --exponent and --alpha.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    parser.add_argument(
        "--exponent",
        type=finite,
        metavar="P",
        help="Blinn-Phong exponent, 1 to 1e5, larger is sharper",
    )
    parser.add_argument(
        "--alpha",
        type=finite,
        metavar="A",
        help="GGX roughness alpha instead, 0.01 to 1, smaller is sharper",
    )


def add_direction(parser: argparse.ArgumentParser) -> None:
    """Add --direction and --colour.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    parser.add_argument(
        "--direction",
        type=finite,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="toward the light: right, up, toward the viewer; of any length",
    )
    add_colour(
        parser, "colour of that light, sRGB in hexadecimal (default ffffff, the photo's white)"
    )


def add_colour(parser: argparse.ArgumentParser, what: str) -> None:
    """Add --colour, and its former spelling --color, which is hidden.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    what : str
        Help text of the option.
    """
    parser.add_argument("--colour", dest="color", type=color, metavar="RRGGBB", help=what)
    parser.add_argument("--color", type=_former_color, help=argparse.SUPPRESS)


def _former_color(text: str) -> np.ndarray:
    sys.stderr.write("isc: note: --color is now --colour\n")
    return color(text)


def lobe_of(options: argparse.Namespace) -> Lobe | None:
    """Return the lobe of --exponent or --alpha.

    Parameters
    ----------
    options : argparse.Namespace

    Returns
    -------
    Lobe or None
        None if neither is given.

    Raises
    ------
    InputError
        If both are given.
    """
    if options.exponent is not None and options.alpha is not None:
        raise InputError("--exponent and --alpha both set the lobe's width: give one of them")
    if options.exponent is None and options.alpha is None:
        return None
    return Lobe(DEFAULT_EXPONENT if options.exponent is None else options.exponent, options.alpha)


def color(text: str) -> np.ndarray:
    """Parse a colour RRGGBB, sRGB in hexadecimal.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    (3,) ndarray
        Linear light.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not a colour.
    """
    digits = text.removeprefix("#")
    try:
        codes = np.array([int(digits[k : k + 2], 16) for k in (0, 2, 4)])
    except ValueError:
        codes = np.zeros(0)
    if len(digits) != 6 or len(codes) != 3 or not (digits.isascii() and digits.isalnum()):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a colour: expected RRGGBB, such as 2060c0"
        )
    return srgb_to_linear(codes / 255)


def plain(value: object) -> object:
    """Convert a value to JSON-ready types.

    Parameters
    ----------
    value : object
        Arrays become lists, paths strings.

    Returns
    -------
    object
    """
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return readable(str(value)) if isinstance(value, Path) else value
