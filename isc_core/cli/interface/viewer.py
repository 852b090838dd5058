"""Showing a picture in the system's viewer, for --open."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path


def show(picture: Path) -> Iterator[str]:
    """Show a picture, without waiting for the viewer.

    Parameters
    ----------
    picture : Path

    Yields
    ------
    str
        A note, if the system has no viewer.
    """
    if sys.platform == "win32":
        os.startfile(picture)
        return
    opener = shutil.which("open" if sys.platform == "darwin" else "xdg-open")
    if opener is None:
        yield "note: --open found no viewer (xdg-open)"
        return
    nothing = subprocess.DEVNULL
    command = [opener, str(picture)]
    subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing, start_new_session=True)
