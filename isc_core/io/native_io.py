"""Workarounds for native libraries, which open files by name only and print to the terminal.

Problem: a library that opens a file itself may read other bytes than those that were checked, since
files change, and some accept only UTF-8 names: `memory_file` provides checked bytes under an ASCII
name. Decoders of damaged files print warnings, through Python or directly to standard error; only
the `InputError` that follows is meant for the user: `suppress_native_output` mutes the rest.

Limits: memory files are in memory on Linux, in the temporary folder elsewhere. File descriptor 2
belongs to the whole process: output of other threads is muted as well.
"""

import contextlib
import io
import os
import tempfile
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_DESCRIPTORS = Path("/proc/self/fd")


@contextmanager
def memory_file(content: bytes = b"") -> Iterator[Path]:
    """Provide a path to a file with given content; the file is gone after the block.

    Parameters
    ----------
    content : bytes

    Returns
    -------
    Path
        The file; in memory where the system allows it, else in a temporary folder.
    """
    if hasattr(os, "memfd_create") and _DESCRIPTORS.is_dir():
        with open(os.memfd_create("isc"), "wb") as file:
            file.write(content)
            file.flush()
            yield _DESCRIPTORS / str(file.fileno())
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "content"
        path.write_bytes(content)
        yield path


@contextmanager
def suppress_native_output() -> Iterator[None]:
    """Mute warnings and all output of the process within the block.

    Blocks of several threads may overlap: the output returns at the end of the last.
    """
    _MUTE.begin()
    try:
        yield
    finally:
        _MUTE.end()


class _Mute:
    """Mutes the process while at least one block runs.

    If each block restored what it found, the end of the second of two overlapping blocks would
    restore the muted output of the first, for good.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._blocks = 0
        self._restore = contextlib.ExitStack()

    def begin(self) -> None:
        with self._lock:
            if not self._blocks:
                self._restore.enter_context(_muted_process())
            self._blocks += 1

    def end(self) -> None:
        with self._lock:
            self._blocks -= 1
            if not self._blocks:
                self._restore.close()


_MUTE = _Mute()


@contextmanager
def _muted_process() -> Iterator[None]:
    with (
        warnings.catch_warnings(),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.ExitStack() as stack,
    ):
        warnings.simplefilter("ignore")
        with contextlib.suppress(OSError):  # programs without a terminal may have no descriptor 2
            saved = os.dup(2)
            stack.callback(os.close, saved)
            stack.callback(os.dup2, saved, 2)
            null = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, null)
            os.dup2(null, 2)
        yield
