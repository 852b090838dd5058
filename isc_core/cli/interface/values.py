"""Types of command-line options, with one-line errors."""

import argparse
import math
import re
import sys
from collections.abc import Callable

MAPS_SIZE = -1  # value of `texture_size` for "maps"


class Location(str):
    """The path of a file or folder, as opposed to the other values that its option takes."""


def location(*words: str) -> Callable[[str], str]:
    """Return the type of an option that takes a path, a URL, or one of some words.

    Parameters
    ----------
    *words : str
        Values that are not paths.

    Returns
    -------
    callable
        Marks a path as `Location`, so that a configuration file can give it relative to itself.
    """

    def read(text: str) -> str:
        return text if "://" in text or text in words else Location(text)

    return read


def current_name(setting: str) -> Callable[[str], str]:
    """Return the type of an option whose values were renamed.

    Parameters
    ----------
    setting : str
        Field of `Settings`.

    Returns
    -------
    callable
        Replaces a value of an earlier version, and prints the new one on stderr.
    """

    def read(text: str) -> str:
        from ...decomposition.settings import renamed_value

        current = renamed_value(setting, text)
        if current is None:
            return text
        option = f"--{setting.replace('_', '-')}"
        sys.stderr.write(f"isc: {option} {text} is now called {current}: use {option} {current}\n")
        return str(current)

    return read


def texture_size(text: str) -> int:
    """Parse the longest side of a texture.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    int
        Pixels, 0 for the photo's, `MAPS_SIZE` for that of the maps.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not one.
    """
    names = {"photo": 0, "maps": MAPS_SIZE}
    if text in names:
        return names[text]
    if not text.isascii() or not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not photo, maps or a number of pixels")
    return int(text)


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


def memory_size(text: str) -> int:
    """Parse an amount of memory, such as 2GB.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    int
        Bytes.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not one.
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?)\s*([kmgt]?i?)b\s*", text.lower())
    if found is None or not float(found[1]):
        raise argparse.ArgumentTypeError(f"{text!r} is not an amount of memory, such as 2GB")
    thousand = 1024 if found[2].endswith("i") else 1000
    return int(float(found[1]) * thousand ** " kmgt".index(found[2][:1] or " "))


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


def not_negative(text: str) -> float:
    """Parse a finite number of 0 or more.

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
    if value is None or value < 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number, 0 or more")
    return value


def share(text: str) -> float:
    """Parse a number from 0 to 1.

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
    if value is None or not 0 <= value <= 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to 1")
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


def pixel(text: str) -> tuple[int, int]:
    """Parse a pixel.

    Parameters
    ----------
    text : str
        Value on the command line.

    Returns
    -------
    tuple of int
        Column and row.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is not one.
    """
    try:
        x, y = (int(part) for part in text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not two integers x,y") from error
    return x, y
