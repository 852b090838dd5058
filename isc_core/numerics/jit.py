"""Loops over pixels that NumPy cannot express, compiled where Numba is there and plain Python,
slower but alike, where it is not.

Compiled code is kept between runs: beside the source where that can be written, else in the user's
cache folder, or where NUMBA_CACHE_DIR says; where none of them can be written, in a folder that
lasts as long as the process.
"""

import atexit
import contextlib
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TypeVar, cast

Loop = TypeVar("Loop", bound=Callable[..., object])


def compiled(loop: Loop) -> Loop:
    """`loop`, a function on numbers and arrays that Numba can compile, made fast if possible; it
    releases the interpreter's lock.
    """
    try:
        import numba
    except ImportError:
        return loop
    ensure_cache_folder()
    dispatcher = numba.njit(cache=True, nogil=True, error_model="numpy")(loop)
    drop_broken(Path(str(dispatcher.stats.cache_path)))
    return cast(Loop, dispatcher)


@cache
def drop_broken(folder: Path) -> None:
    """Removes what a loss of power, or a full disk, cut short of the compiled code that is kept in
    `folder`: Numba would fail on it, at every start.
    """
    for kept in folder.glob("*.nb[ic]"):
        with contextlib.suppress(OSError):  # another process replaced it, or it cannot be removed
            if not kept.read_bytes().endswith(b"."):  # as all that `pickle` writes does
                kept.unlink()


def ensure_cache_folder() -> None:
    """Gives Numba a folder that lasts as long as this process, where it finds none to write to: it
    would refuse to work.
    """
    try:
        import numba
    except ImportError:
        return
    try:
        numba.njit(cache=True)(_probe)
    except RuntimeError:
        folder = tempfile.mkdtemp(prefix="isc-kernels-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        setattr(numba.config, "CACHE_DIR", folder)  # noqa: B010 (the module's own declaration of it is dynamic)


def _probe() -> None:
    """Lies among the package's modules, so that Numba looks for a cache where it will look for
    theirs.
    """
