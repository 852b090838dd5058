"""The ways in which ISC ends on purpose other than by success."""

from collections.abc import Sequence


class InputError(ValueError):
    """Something the user gave cannot be used.

    The message is one line: what is wrong and what to do about it. The command line prints it and
    exits with 2. Names that files bring along may stand in it: what would break the line or steer a
    terminal (line ends, escapes, marks of direction) is written as its code.
    """

    def __init__(self, message: str) -> None:
        super().__init__("".join(c if c.isprintable() else ascii(c)[1:-1] for c in message))


class Cancelled(Exception):
    """The user asked to stop. The command line exits with 130; nothing half-written is left."""


class Rejected(Exception):
    """The work was done and its result is written, but what was measured breaks a bound.

    The message says which, a line each. The command line prints it and exits with 1. Also where
    some of several inputs failed, and the others are done.

    Parameters
    ----------
    message : str
    lines : sequence of str, optional
        What is printed of that which is done.
    """

    def __init__(self, message: str, lines: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.lines = lines
