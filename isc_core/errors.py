"""Exceptions by which ISC ends deliberately without success."""

from collections.abc import Sequence


class InputError(ValueError):
    """An input of the user cannot be used.

    The message is one line: what is wrong and what to do about it. The command line prints it and
    exits with 2. The message may contain names from files: characters that would break the line or
    control a terminal (line ends, escapes, bidirectional marks) are escaped.
    """

    def __init__(self, message: str) -> None:
        super().__init__("".join(c if c.isprintable() else ascii(c)[1:-1] for c in message))


class Cancelled(Exception):
    """The user cancelled. The command line exits with 130; no file is left incomplete.

    It also prints the notes of the exception (`add_note`): how the user can go on.
    """


class Rejected(Exception):
    """The work was done and its result is written, but a measurement violates a bound.

    The message names each, one per line. The command line prints it and exits with 1. Also raised
    where some of several inputs failed and the others succeeded.

    Parameters
    ----------
    message : str
    lines : sequence of str, optional
        Lines to print about the completed inputs.
    """

    def __init__(self, message: str, lines: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.lines = lines
