"""Results of stages of the pipeline, kept for the next run with other settings.

Problem: a second run on the same photo, with another separator for example, repeats stages whose
input has not changed.

Equation: the result of a stage is kept under the SHA-256 of everything that it depends on: the
name of the stage, the types, shapes and bytes of its input arrays, the versions of ISC, Python and
NumPy, the kind of processor, and the stamp of the source files (`source_stamp`). A file also has
the SHA-256 of its key and of its own arrays. If that differs, or if the file cannot be read, the
stage is computed again. So the result is the same with and without the cache.

Citation: D. Michie, "'Memo' functions and machine learning", Nature 218 (1968), 19-22,
doi:10.1038/218019a0; FIPS 180-4, Secure Hash Standard, 2015.

Limits: nothing is deleted here; whoever owns the folder limits its size. A folder that computers
with different processors of one kind share may return results whose last digits are those of
another computer.
"""

import contextlib
import hashlib
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np

from .. import __version__
from ..errors import InputError
from .atomic import new_file
from .npy import read_arrays, write_archive
from .source_stamp import source_stamp

SUFFIX = ".npz"  # of the files in the folder; the Blender add-on limits their size
_CHECK = "sha256"
_PACKAGE = Path(__file__).resolve().parents[1]
Arrays = Mapping[str, np.ndarray]


class KeptStages(Protocol):
    """Where results of stages are kept."""

    def arrays(
        self, stage: str, inputs: Sequence[np.ndarray], compute: Callable[[], Arrays]
    ) -> Arrays:
        """Return the result of a stage, computed unless it is kept.

        Parameters
        ----------
        stage : str
            Name of the stage.
        inputs : sequence of ndarray
            All that the result depends on, besides the program.
        compute : callable
            The stage, see `StageCache.arrays`.

        Returns
        -------
        mapping of str to ndarray
        """
        ...


@dataclass(frozen=True)
class StageCache:
    """A folder of results of stages.

    Attributes
    ----------
    folder : Path
        Created when it is first written to.
    """

    folder: Path

    def arrays(
        self, stage: str, inputs: Sequence[np.ndarray], compute: Callable[[], Arrays]
    ) -> Arrays:
        """Return the result of a stage, computed unless it is kept.

        Parameters
        ----------
        stage : str
            Name of the stage.
        inputs : sequence of ndarray
            All that the result depends on, besides the program.
        compute : callable
            The stage: returns its result as arrays, none of them an object array.

        Returns
        -------
        mapping of str to ndarray
        """
        key = _key(stage, inputs)
        place = self.folder / f"{key.hex()}{SUFFIX}"
        kept = _read(place, key)
        if kept is not None:
            return kept
        made = compute()
        with contextlib.suppress(InputError):  # a full or read-only disk does not stop the work
            _write(place, key, made)
        return made


def _key(stage: str, inputs: Sequence[np.ndarray]) -> bytes:
    digest = hashlib.sha256(_program())
    _add(digest, {f"{stage} {number}": array for number, array in enumerate(inputs)})
    return digest.digest()


@cache
def _program() -> bytes:
    """What of the program a result depends on."""
    versions = __version__, platform.python_version(), np.__version__, platform.machine()
    return repr(versions).encode() + source_stamp(_PACKAGE)


def _add(digest: "hashlib._Hash", arrays: Arrays) -> None:
    for name, array in sorted(arrays.items()):
        digest.update(repr((name, array.dtype.str, array.shape)).encode())
        digest.update(array.tobytes())


def _check(key: bytes, arrays: Arrays) -> np.ndarray:
    """The SHA-256 of a key and of arrays, (32,) uint8."""
    digest = hashlib.sha256(key)
    _add(digest, arrays)
    return np.frombuffer(digest.digest(), np.uint8)


def _read(place: Path, key: bytes) -> Arrays | None:
    """The arrays of a file, if it is intact and belongs to the key."""
    try:
        arrays = read_arrays(place)
    except InputError:
        return None
    if not np.array_equal(arrays.pop(_CHECK, np.empty(0)), _check(key, arrays)):
        return None
    with contextlib.suppress(OSError):  # somebody else's folder can still be read
        os.utime(place)
    return arrays


def _write(place: Path, key: bytes, arrays: Arrays) -> None:
    with new_file(place) as partial, partial.open("wb") as file:
        write_archive(file, {_CHECK: _check(key, arrays), **arrays})
