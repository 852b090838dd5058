"""Option parsing: a parser with one-line errors, and the option types that commands share."""

import argparse
import math
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from ...decomposition.settings import (
    ILLUMINATIONS,
    LIGHT_COLOURS,
    LIGHT_PRIORS,
    MODELS,
    SHAPE_PRIORS,
    Settings,
    renamed_value,
)
from ...errors import InputError
from ...io.limits import USUAL, Limits
from ...photo import TRANSFERS
from ...separation import METHODS

Commands = Any  # the type that `add_subparsers` returns is private


class _Help(argparse.RawDescriptionHelpFormatter):
    """Keeps the line breaks of the examples, and wraps other text."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        keep = "\n" in text
        return super()._fill_text(
            text if keep else "\n".join(textwrap.wrap(text, width)), width, indent
        )


class Parser(argparse.ArgumentParser):
    """An argument parser that raises `InputError` instead of printing its usage.

    Options cannot be abbreviated, so that new ones never change old scripts.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=_Help, **options)

    def error(self, message: str) -> NoReturn:
        """Raise the error of a command line as `InputError`.

        Parameters
        ----------
        message : str
            What is wrong.

        Raises
        ------
        InputError
            Always.
        """
        raise InputError(f"{message} (see `{self.prog} --help`)")


def add_command(
    commands: Commands, name: str, run: Any, summary: str, description: str, examples: str
) -> argparse.ArgumentParser:
    """Add the parser of a sub-command, with the options that all commands have.

    Parameters
    ----------
    commands : object
        Returned by `add_subparsers`.
    name : str
    run : callable
        Called with the options and a `Monitor`.
    summary, description, examples : str

    Returns
    -------
    argparse.ArgumentParser
    """
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary,
        description=description,
        epilog=f"examples:\n{examples}" if examples else None,
    )
    parser.set_defaults(run=run)
    add_output_options(parser)
    return parser


def add_output_options(parser: argparse.ArgumentParser, *, again: bool = False) -> None:
    """Add --quiet and --progress.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    again : bool
        For an action of a command that has them, so that they may precede or follow it.
    """
    default = (
        argparse.SUPPRESS if again else None
    )  # an option before the action must not be reset by a default after it
    parser.add_argument(
        "--quiet",
        action="store_true",
        default=default or False,
        help="show no progress and print results only",
    )
    parser.add_argument(
        "--progress",
        choices=("bar", "json"),
        default=default or "bar",
        help="json: for programs, one JSON object per line on stdout, cancelled by `cancel` or the "
        "end of stdin (default bar)",
    )


def hints(options: argparse.Namespace, *lines: str) -> list[str]:
    """Return the lines, or none with --quiet.

    Parameters
    ----------
    options : argparse.Namespace
    *lines : str

    Returns
    -------
    list of str
    """
    return [] if options.quiet else list(lines)


def add_photo(parser: argparse.ArgumentParser) -> None:
    """Add PHOTO, --mask, --transfer and --max-pixels.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    parser.add_argument(
        "photo",
        metavar="PHOTO",
        type=Path,
        help="8- or 16-bit PNG, JPEG, TIFF, BMP, PPM, EXR, HDR or NumPy .npy",
    )
    parser.add_argument(
        "--mask",
        type=Path,
        metavar="MASK",
        help="image of the photo's size, the object white on black (default: the photo's alpha "
        "channel, else the pixels that are not black)",
    )
    add_transfer(parser)
    add_limits(parser)


def add_transfer(parser: argparse.ArgumentParser) -> None:
    """Add --transfer.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    parser.add_argument(
        "--transfer",
        choices=TRANSFERS,
        default="auto",
        help="encoding of the photo (auto: EXR, HDR and floats of .npy are linear, else sRGB)",
    )


def add_limits(parser: argparse.ArgumentParser) -> None:
    """Add --max-pixels.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    parser.add_argument(
        "--max-pixels",
        type=whole,
        default=USUAL.max_pixels,
        metavar="N",
        help="reject images with more pixels (width x height) before decoding them "
        "(default %(default)s)",
    )


def limits_of(options: argparse.Namespace) -> Limits:
    """Return the limits of files that a command reads.

    Parameters
    ----------
    options : argparse.Namespace

    Returns
    -------
    Limits
    """
    return Limits(max_pixels=options.max_pixels)


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options of `Settings` except --engine and --threads; and --priors and --arrays.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    defaults = Settings()
    parser.add_argument(
        "--model",
        default=defaults.model,
        metavar="NAME",
        help=f"{', '.join(MODELS)} (default {defaults.model})",
    )
    parser.add_argument(
        "--separator",
        default=defaults.separator,
        metavar="NAME",
        help=f"separation method: {', '.join(METHODS)} (default {defaults.separator})",
    )
    parser.add_argument(
        "--illumination",
        choices=ILLUMINATIONS,
        default=defaults.illumination,
        help="prior of the illumination (default %(default)s)",
    )
    parser.add_argument(
        "--max-size",
        type=count,
        default=defaults.max_size,
        metavar="N",
        help="long side of the object in the maps, in pixels (default %(default)s; 0: the photo's)",
    )
    parser.add_argument(
        "--full-size", action="store_true", help="upsample the result to the photo's resolution"
    )
    parser.add_argument(
        "--shading-only", action="store_true", help="shape from shading: the object has one colour"
    )
    parser.add_argument(
        "--confidence-weights",
        action="store_true",
        help="for joint and mdr: weight pixels by the confidence of their separation",
    )
    parser.add_argument(
        "--light-colour",
        choices=LIGHT_COLOURS,
        default=defaults.light_colour,
        help="colour of the light: white, or estimated from highlights where they determine it "
        "(default %(default)s)",
    )
    parser.add_argument(
        "--light-prior",
        type=current_name("light_prior"),
        choices=LIGHT_PRIORS,
        default=defaults.light_prior,
        help="prior of the light: predicted from the photo, or that of the data set "
        "(default %(default)s)",
    )
    parser.add_argument(
        "--shape-prior",
        type=current_name("shape_prior"),
        choices=SHAPE_PRIORS,
        default=defaults.shape_prior,
        help="prior of the shape: predicted from the photo, or from its silhouette alone "
        "(default %(default)s)",
    )
    parser.add_argument(
        "--arrays",
        action="store_true",
        help="write arrays.npz too: everything as plain NumPy arrays, for other programs",
    )
    parser.add_argument(
        "--priors",
        type=Path,
        metavar="FILE",
        help="a file of isc fit-priors (default: those of the package)",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=defaults.seed,
        metavar="N",
        help="random seed, recorded in the result (default %(default)s)",
    )


def add_engine(
    parser: argparse.ArgumentParser, threads: str = "number of threads (0: one per core)"
) -> None:
    """Add --engine and --threads.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    threads : str
        Help text of --threads.
    """
    parser.add_argument(
        "--engine",
        choices=("auto", "numba", "numpy"),
        default="auto",
        help="compiled kernels, or plain NumPy (auto: compiled if possible)",
    )
    parser.add_argument("--threads", type=count, default=0, metavar="N", help=threads)


def current_name(setting: str) -> Callable[[str], str]:
    """Make the type of an option whose values were renamed.

    Parameters
    ----------
    setting : str
        Field of `Settings`.

    Returns
    -------
    callable
        Replaces a value of an earlier version, and names the new one on stderr.
    """

    def read(text: str) -> str:
        current = renamed_value(setting, text)
        if current is None:
            return text
        option = f"--{setting.replace('_', '-')}"
        sys.stderr.write(f"isc: {option} {text} is now called {current}: use {option} {current}\n")
        return str(current)

    return read


def count(text: str) -> int:
    """Parse a whole number, 0 or more.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    int

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not one.
    """
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, 0 or more")
    return value


def whole(text: str) -> int:
    """Parse a whole number, 1 or more.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    int

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not one.
    """
    value = count(text)
    if value == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, 1 or more")
    return value


def number(text: str) -> float:
    """Parse a finite number other than 0.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    float

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not one.
    """
    value = _finite_or_none(text)
    if not value:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number other than 0")
    return value


def finite(text: str) -> float:
    """Parse a finite number.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    float

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not one.
    """
    value = _finite_or_none(text)
    if value is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number")
    return value


def _finite_or_none(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def positive(text: str) -> float:
    """Parse a finite number greater than 0.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    float

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not one.
    """
    value = number(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not above 0")
    return value


def names(text: str) -> tuple[str, ...]:
    """Parse names separated by commas.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    tuple of str

    Raises
    ------
    argparse.ArgumentTypeError
        If there is no name.
    """
    parsed = tuple(name.strip() for name in text.split(",") if name.strip())
    if not parsed:
        raise argparse.ArgumentTypeError("give at least one name")
    return parsed
