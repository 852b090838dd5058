"""Reading the archives of arrays that the programs of this package write."""

import lzma
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.lib.npyio import NpzFile

from isc_core.errors import InputError

_DAMAGES = (ValueError, TypeError, KeyError, EOFError, BadZipFile, zlib.error, lzma.LZMAError)


@contextmanager
def open_archive(path: Path, content: str, remedy: str) -> Iterator[NpzFile]:
    """Open an archive; errors in the block count as damage of the file.

    Parameters
    ----------
    path : Path
    content : str
        What it should be, for the error message.
    remedy : str
        What to do otherwise.

    Returns
    -------
    NpzFile

    Raises
    ------
    InputError
        If the file cannot be read, is damaged or something else.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            yield data
    except InputError:
        raise
    except OSError as error:
        reason = error.strerror or "it is damaged"
        raise InputError(f"{path} cannot be read ({reason}): {remedy}") from error
    except _DAMAGES as error:
        raise InputError(f"{path} is damaged or not {content}: {remedy}") from error
