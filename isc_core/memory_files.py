"""Bytes under a name, for libraries that can only open names.

Problem: a library that opens a file by itself may find other bytes than those that were checked and
whose sum was taken, since files change; and some take no names but UTF-8. Here it gets a name of
its own in ASCII, and nobody else writes there.

Limits: in memory on Linux; elsewhere in the folder for temporary files.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_DESCRIPTORS = Path("/proc/self/fd")


@contextmanager
def named(content: bytes = b"") -> Iterator[Path]:
    """The path of a file that holds `content`; it is gone after the block."""
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
