"""Local copies of inputs: a path is used directly, a URL is copied to a temporary file by fsspec.

Limits: a file larger than `Limits.max_bytes` is rejected; an object of a store as soon as its copy
exceeds the limit. Credentials and options of a store are read by its fsspec implementation from the
environment of the workers.
"""

import hashlib
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import InputError
from ..extras import install_command
from ..io.limits import Limits
from ..io.regular_files import require_regular

_BLOCK = 1 << 20
_REMEDY = "use an image file"


def is_url(location: str) -> bool:
    """Return whether a location is a URL for fsspec, such as s3://bucket/cup.png.

    Parameters
    ----------
    location : str
        Path or URL.

    Returns
    -------
    bool
    """
    return "://" in location


def fsspec_module() -> ModuleType:
    """Return fsspec, or raise `InputError` if it is not installed."""
    try:
        import fsspec
    except ImportError as error:
        raise InputError(
            f"URLs need fsspec ({error}): install it with `{install_command('batch')}`"
        ) from error
    return fsspec  # type: ignore[no-any-return]


def file_system(url: str) -> tuple[Any, str]:
    """Return the fsspec file system of a URL, and the path in it.

    Parameters
    ----------
    url : str

    Returns
    -------
    file_system : fsspec.AbstractFileSystem
    path : str

    Raises
    ------
    InputError
        If there is no such file system.
    """
    fsspec = fsspec_module()
    try:
        return fsspec.core.url_to_fs(url)  # type: ignore[no-any-return]
    except (ImportError, ValueError) as error:
        raise InputError(f"{url} cannot be reached: {error}") from error


@contextmanager
def local_copy(location: str, limits: Limits, folder: Path) -> Iterator[Path]:
    """Provide a local file with the content of a location.

    Parameters
    ----------
    location : str
        A path or URL.
    limits : Limits
    folder : Path
        Folder of the copies.

    Returns
    -------
    Path
        For the duration of the block.

    Raises
    ------
    InputError
        If the location cannot be read.
    """
    if not is_url(location):
        yield _checked(location, limits)
        return
    system, path = file_system(location)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as folder_name:
        copy = Path(folder_name) / "file"
        try:
            require_object(system, path, _REMEDY)
            with system.open(path, "rb") as source, copy.open("wb") as target:
                length = 0
                while block := source.read(_BLOCK):
                    length += len(block)
                    _check_length(location, length, limits)
                    target.write(block)
        except OSError as error:
            raise InputError(
                f"{location}: cannot be read: {error.strerror or error or 'no such object'}"
            ) from error
        yield copy


def require_object(system: Any, path: str, remedy: str) -> None:
    """Check that a path of a file system is an object, not a pipe or a device of the machine.

    Parameters
    ----------
    system : fsspec.AbstractFileSystem
    path : str
    remedy : str
        End of the error message.

    Raises
    ------
    InputError
        If it is a folder, pipe or device.
    OSError
        If it does not exist.
    """
    from fsspec.implementations.local import LocalFileSystem

    if isinstance(system, LocalFileSystem):
        require_regular(path, None, remedy)


def _checked(location: str, limits: Limits) -> Path:
    try:
        require_regular(location, limits, _REMEDY)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InputError(f"{location}: there is no such file") from error
    except OSError as error:
        raise InputError(f"{location}: cannot be read: {error.strerror}") from error
    return Path(location)


def _check_length(location: str, length: int, limits: Limits) -> None:
    if length > limits.max_bytes:
        raise InputError(
            f"{location}: more than {limits.max_bytes / 1e9:.1f} GB, too large for a photo: reduce "
            "it first"
        )


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str
        Hexadecimal.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
