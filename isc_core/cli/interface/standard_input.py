"""A photo from standard input, which has the name `-`.

Readers need files, because images are detected, checked and decoded in several passes. The stream
is copied to a temporary file first.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...errors import InputError
from .options import limits_of

STDIN = Path("-")
_NAME = "standard input"


@contextmanager
def photo_file(path: Path, options: argparse.Namespace) -> Iterator[Path]:
    """Provide the file of a photo.

    Parameters
    ----------
    path : Path
        The file, or `-` for standard input.
    options : argparse.Namespace
        Of the command; its limits bound the size of the stream.

    Yields
    ------
    Path
        The file; that of standard input exists only inside the context.

    Raises
    ------
    InputError
        If standard input is a terminal, is used by --progress json, or exceeds the limits.
    """
    if path != STDIN:
        yield path
        return
    if sys.stdin is None or sys.stdin.isatty():
        raise InputError("- reads the photo from standard input: redirect a file to it")
    if options.progress == "json":
        raise InputError("--progress json reads commands from standard input: give a file, not -")
    with tempfile.TemporaryDirectory(prefix="isc-") as folder:
        copy = Path(folder) / "stdin"
        limits = limits_of(options)
        with copy.open("wb") as file:
            while block := sys.stdin.buffer.read(1 << 20):
                file.write(block)
                limits.check_stored(_NAME, file.tell())
        try:
            yield copy
        except InputError as error:
            raise InputError(str(error).replace(str(copy), _NAME)) from error
