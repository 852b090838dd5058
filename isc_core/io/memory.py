"""Out-of-memory errors that state how much memory is needed.

Problem: libraries report exhausted memory in many ways: as `MemoryError`, as the text of a C++
exception, or only as damaged data (libjpeg). An error that is mistaken for damage suggests the
wrong remedy.

Limits: the amounts are estimates for the usual code path, within about a third. Linux overcommits
memory and kills a process that uses too much, which the process cannot report: work that is known
to need more than the free memory is rejected before it begins (`require_memory`).
"""

import contextlib
import ctypes
import mmap
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError

_SYSTEM, _GROUP = Path("/proc/meminfo"), Path("/sys/fs/cgroup")
# Of glibc's malloc.h: M_ARENA_MAX, M_MMAP_THRESHOLD (its largest) and M_TRIM_THRESHOLD.
_MALLOC_OPTIONS = {-8: 1, -3: 1 << 25, -1: 1 << 27}
LARGE_PHOTO = 1 << 18  # pixels: only above is it worth the time to return memory to the system
READING_BYTES_PER_PIXEL = 32  # bytes per pixel, at most, from the file to linear light
_WORDS = ("out of memory", "nsufficient memory", "bad_alloc", "bad alloc", "nable to allocate")


def is_exhausted(error: BaseException) -> bool:
    """Return whether an error, or one of its causes, reports exhausted memory.

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
    """Return whether the process can allocate this much memory now.

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


def free_memory(system: Path = _SYSTEM, group: Path = _GROUP) -> int | None:
    """Return the memory available to processes, in bytes.

    Parameters
    ----------
    system : Path, optional
        Linux's report of the machine's memory.
    group : Path, optional
        Folder of the control group's limits, as of a container.

    Returns
    -------
    int or None
        None where the system does not report it.
    """
    known = []
    try:
        lines = dict(line.split(":", 1) for line in system.read_text("ascii").splitlines())
        known.append(1024 * int(lines["MemAvailable"].split()[0]))
    except (OSError, ValueError, KeyError):
        return None
    try:
        most, used = (int((group / f"memory.{n}").read_text("ascii")) for n in ("max", "current"))
        known.append(most - used)
    except (OSError, ValueError):  # no group, or one without a limit: "max"
        pass
    return max(0, min(known))


def reuse_memory() -> None:
    """Let threads reuse freed memory, also each other's, where the C library is glibc.

    By default it gives each thread a heap of its own, and returns large blocks to the system, which
    clears them when they are allocated again. To be called before there are other threads.
    """
    for option, value in _MALLOC_OPTIONS.items():
        _allocator("mallopt", option, value)


def release_memory() -> None:
    """Return freed memory to the system, where the C library is glibc.

    The allocator keeps freed memory for reuse: after work on large arrays, as much as is in use.
    """
    _allocator("malloc_trim", 0)


def _allocator(name: str, *arguments: int) -> None:
    """Call a function of glibc's allocator, if that is this process's."""
    if sys.platform == "linux":
        with contextlib.suppress(AttributeError):  # another library than glibc
            getattr(ctypes.CDLL(None), name)(*arguments)


def require_memory(work: str, needed: int, allowed: int | None, remedy: str) -> None:
    """Raise `InputError` for work that needs more memory than is allowed.

    Parameters
    ----------
    work : str
        What needs the memory, in the plural: the prefix of the message.
    needed : int
        In bytes.
    allowed : int or None
        In bytes; None for the free memory.
    remedy : str
        End of the message.

    Raises
    ------
    InputError
        If the work needs more.
    """
    free = free_memory() if allowed is None else allowed
    if free is None or needed <= free:
        return
    if allowed is None:
        raise memory_error(work, needed, remedy)
    raise InputError(
        f"{work} need about {_amount(needed)} of memory, more than the {_amount(allowed)} of "
        f"--memory: allow more, or {remedy}"
    )


def _amount(size: int) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e8 else f"{size / 1e6:.1f} MB"


def memory_error(work: str, needed: int, remedy: str) -> InputError:
    """Return the error for work without enough memory.

    Parameters
    ----------
    work : str
        What needs the memory, in the plural: the prefix of the message.
    needed : int
        In bytes.
    remedy : str
        End of the message.

    Returns
    -------
    InputError
    """
    return InputError(
        f"{work} need about {_amount(needed)} of memory, more than is available: {remedy}"
    )


def memory_message(error: MemoryError, remedy: str) -> str:
    """Return the message for work whose memory is not known beforehand.

    Parameters
    ----------
    error : MemoryError
        NumPy's states the amount: "Unable to allocate 7.45 GiB for an array with shape ...".
    remedy : str
        End of the message.

    Returns
    -------
    str
    """
    amount = f" ({error})" if str(error) else ""
    return f"not enough memory{amount}: {remedy}"


@contextmanager
def enough_memory(work: str, needed: int, remedy: str) -> Iterator[None]:
    """Convert a `MemoryError` of the block into an error that states the memory needed.

    Parameters
    ----------
    work : str
        What needs the memory, in the plural: the prefix of the message.
    needed : int
        In bytes.
    remedy : str
        End of the message.

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
