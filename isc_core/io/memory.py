"""Exhausted memory as an error that says how much is needed.

Problem: libraries report exhausted memory in many ways: as `MemoryError`, as the words of a C++
exception, or as nothing but damaged data (libjpeg). Taken for damage, the error sends the user to
the wrong remedy.

Limits: the amounts are estimates for the usual path, within about a third. Linux grants more memory
than there is, and ends a process that uses it; no process can report that.
"""

import mmap
from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import InputError

READING = 32  # bytes a pixel, at most, from the file to linear light
_WORDS = ("out of memory", "nsufficient memory", "bad_alloc", "bad alloc", "nable to allocate")


def is_exhausted(error: BaseException) -> bool:
    """Tell whether an error, or one of its causes, says that memory is exhausted.

    Parameters
    ----------
    error : BaseException

    Returns
    -------
    bool
    """
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError) or any(word in str(cause) for word in _WORDS):
            return True
        cause = cause.__cause__ or cause.__context__
    return False


def is_available(needed: int) -> bool:
    """Tell whether the process may allocate this much memory now.

    Parameters
    ----------
    needed : int
        In bytes.

    Returns
    -------
    bool
    """
    try:
        mmap.mmap(-1, max(needed, 1)).close()  # reserved, not touched
    except OSError:
        return False
    return True


def memory_error(work: str, needed: int, remedy: str) -> InputError:
    """Return the error for work that memory does not suffice for.

    Parameters
    ----------
    work : str
        What needs the memory, in the plural: opens the message.
    needed : int
        In bytes.
    remedy : str
        Ends the message.

    Returns
    -------
    InputError
    """
    amount = f"{needed / 1e9:.1f} GB" if needed >= 1e8 else f"{needed / 1e6:.1f} MB"
    return InputError(f"{work} need about {amount} of memory, more than is available: {remedy}")


def memory_message(error: MemoryError, remedy: str) -> str:
    """Return the message for work whose need is not known beforehand.

    Parameters
    ----------
    error : MemoryError
        NumPy's says how much: "Unable to allocate 7.45 GiB for an array with shape ...".
    remedy : str
        Ends the message.

    Returns
    -------
    str
    """
    amount = f" ({error})" if str(error) else ""
    return f"not enough memory{amount}: {remedy}"


@contextmanager
def enough_memory(work: str, needed: int, remedy: str) -> Iterator[None]:
    """Turn a `MemoryError` of the block into an error that says how much is needed.

    Parameters
    ----------
    work : str
        What needs the memory, in the plural: opens the message.
    needed : int
        In bytes.
    remedy : str
        Ends the message.

    Yields
    ------
    None

    Raises
    ------
    InputError
        If memory is exhausted.
    """
    try:
        yield
    except MemoryError as error:
        raise memory_error(work, needed, remedy) from error
