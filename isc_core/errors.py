"""The two ways in which ISC ends early on purpose."""


class InputError(ValueError):
    """Something the user gave cannot be used.

    The message is one line: what is wrong and what to do about it. The command line prints it and exits with 2.
    """


class Cancelled(Exception):
    """The user asked to stop. The command line exits with 130; nothing half-written is left."""
