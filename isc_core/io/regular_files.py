"""Reading of files given by the user, which must be regular files.

Problem: opening a named pipe waits for a writer that may never come; a device such as /dev/zero has
no end; a file of many gigabytes fills the memory. All three are detected from the file's status,
before it is opened.

Limits: another program may replace the file between the check and the opening.
"""

import errno
import os
import stat
from pathlib import Path

from ..errors import InputError
from .limits import DEFAULT_LIMITS, Limits
from .memory import enough_memory


def read_regular(
    path: Path | str, limits: Limits | None = DEFAULT_LIMITS, remedy: str = "use a file"
) -> bytes:
    """Read a regular file.

    Parameters
    ----------
    path : Path or str
    limits : Limits or None
        Bound the size of the file; None for any size.
    remedy : str
        End of the error message for a folder, pipe or device.

    Returns
    -------
    bytes

    Raises
    ------
    InputError
        If it is not a regular file, or too large for the limits or the memory.
    OSError
        If it does not exist or cannot be read; the caller adds the remedy.
    """
    require_regular(path, limits, remedy)
    path = Path(path)
    with enough_memory(f"{path}: its bytes", path.stat().st_size, "use a smaller file"):
        return path.read_bytes()


def require_regular(
    path: Path | str, limits: Limits | None = DEFAULT_LIMITS, remedy: str = "use a file"
) -> None:
    """Check that a path names a regular file, without opening it.

    Parameters
    ----------
    path : Path or str
    limits : Limits or None
        Bound the size of the file; None for any size.
    remedy : str
        End of the error message for a folder, pipe or device.

    Raises
    ------
    InputError
        If it is not a regular file, or too large.
    OSError
        If it does not exist or its status cannot be read.
    """
    try:
        status = os.stat(path)
    except ValueError as error:  # a null byte, which no name may contain
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path)) from error
    if stat.S_ISDIR(status.st_mode):
        raise InputError(f"{path} is a folder: {remedy}")
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{path} is not a regular file: {remedy}")
    if limits is not None:
        limits.check_stored(path, status.st_size)
