"""Reading numbers out of MATLAB files of version 5 to 7.

Problem: a few matrices of research data come as MAT files, from anybody. General readers rebuild
cells, objects and nested records of any depth, and believe the sizes that they are told; all that
is wanted here is one matrix of numbers by its name, or a field of a record. Layout: 128 bytes of
header, then elements (type, size, content), each a matrix or a deflated matrix; a matrix is again
elements: flags, dimensions, name, then its numbers, which may be stored in a smaller type than they
are of, or a record's fields. Citation: The MathWorks, "MAT-File Format", R2023a (2023), chapter 1,
"Level 5 MAT-File Format". Limits: real matrices and records of one row and column; no texts, cells,
sparse or complex matrices; not version 4, nor 7.3 (HDF5).
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from .limits import USUAL, Limits

_HEADER, _MOST_DIMENSIONS, _NAMED = (
    128,
    8,
    1024,
)  # bytes of a file's header; of a matrix's head, which holds its name
_MATRIX, _DEFLATED = 14, 15
_RECORD = 2
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}  # how numbers are stored
_CLASSES = {
    6: "f8",
    7: "f4",
    8: "i1",
    9: "u1",
    10: "i2",
    11: "u2",
    12: "i4",
    13: "u4",
    14: "i8",
    15: "u8",
}  # what they are
_COMPLEX = 0x0800


@dataclass(frozen=True)
class _Matrix:
    """`kind`: its class.

    `flags`: of it. `shape`: rows, columns, ... `rest`: its elements after the name.
    """

    kind: int
    flags: int
    shape: tuple[int, ...]
    name: str
    rest: Iterator[tuple[int, bytes]]


def read_matrix(path: Path, *keys: str, limits: Limits = USUAL) -> np.ndarray:
    """The variable `keys[0]`, or its field `keys[1]` and so on: an array of its shape, at least
    (rows, columns), of its own type.

    Raises `InputError` where the file is absent, damaged, of another version, or holds no such
    numbers.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"cannot read {path} ({error.strerror}): is the data set complete?"
        ) from error
    if data.startswith(b"MATLAB 7.3"):
        raise InputError(f"{path} is a MATLAB 7.3 file: save it with '-v7' and try again")
    try:
        found = _found(path, data, keys, limits)
    except InputError:
        raise
    except (
        ValueError,
        TypeError,
        struct.error,
        zlib.error,
        StopIteration,
        OverflowError,
        MemoryError,
    ) as error:
        raise InputError(f"{path} is not a readable MATLAB file: fetch or save it again") from error
    if found is None:
        raise InputError(f"{path} lacks '{'.'.join(keys)}': is it the file of the data set?")
    return found


def _found(path: Path, data: bytes, keys: tuple[str, ...], limits: Limits) -> np.ndarray | None:
    order = {b"IM": "<", b"MI": ">"}.get(data[_HEADER - 2 : _HEADER])
    if order is None:
        raise ValueError("no mark of the order of bytes")
    for kind, content in _elements(data[_HEADER:], order):
        if kind == _DEFLATED:
            start = zlib.decompressobj().decompress(content, _NAMED)
            if _matrix(start[8:], order).name != keys[0]:
                continue
            kind, content = _inflated(path, content, order, limits, len(data))
        if kind == _MATRIX and content and (matrix := _matrix(content, order)).name == keys[0]:
            return _numbers(matrix, keys[1:], order)
    return None


def _inflated(
    path: Path, content: bytes, order: str, limits: Limits, stored: int
) -> tuple[int, bytes]:
    """A deflated element's type and content; its size is held against the limits first."""
    unpack = zlib.decompressobj()
    kind, size = struct.unpack(f"{order}II", unpack.decompress(content, 8))
    limits.check_unpacked(path, size, stored)
    unpacked = unpack.decompress(unpack.unconsumed_tail, size) if size else b""
    if len(unpacked) < size:
        raise ValueError("cut short")
    return kind, unpacked


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and content of each element; up to four bytes of content may stand beside the type.

    Raises `ValueError` for one cut short.
    """
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        start = at + 8
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, at + 4
            following = at + 8
        else:
            following = start + size + (-size % 8 if kind != _DEFLATED else 0)
        if start + size > (len(data) if start == at + 8 else at + 8):
            raise ValueError("an element is cut short")
        yield kind, data[start : start + size]
        at = following


def _matrix(content: bytes, order: str) -> _Matrix:
    """A matrix's head.

    Raises `ValueError`, `struct.error` or `StopIteration` where there is none.
    """
    parts = _elements(content, order)
    (flags,) = struct.unpack_from(f"{order}I", next(parts)[1])
    sizes = np.frombuffer(next(parts)[1], f"{order}i4")
    shape = tuple(int(n) for n in sizes)
    if not 2 <= len(shape) <= _MOST_DIMENSIONS or min(shape) < 0:
        raise ValueError("no shape")
    return _Matrix(flags & 0xFF, flags, shape, next(parts)[1].decode("latin-1"), parts)


def _numbers(matrix: _Matrix, keys: tuple[str, ...], order: str) -> np.ndarray | None:
    """The matrix's numbers, or those of a field of it; None where it has no such field."""
    if keys:
        return _field(matrix, keys, order)
    if matrix.kind not in _CLASSES or matrix.flags & _COMPLEX:
        raise ValueError("not a matrix of real numbers")
    kind, content = next(matrix.rest)
    stored = np.frombuffer(content, f"{order}{_TYPES.get(kind, 'V')}") if content else np.zeros(0)
    if math.prod(matrix.shape) != stored.size:
        raise ValueError("not as many numbers as the shape says")
    with np.errstate(all="ignore"):
        return stored.astype(_CLASSES[matrix.kind]).reshape(matrix.shape, order="F")


def _field(matrix: _Matrix, keys: tuple[str, ...], order: str) -> np.ndarray | None:
    if matrix.kind != _RECORD or math.prod(matrix.shape) != 1:
        return None
    (length,) = struct.unpack_from(f"{order}i", next(matrix.rest)[1])
    names = next(matrix.rest)[1]
    if length < 1:
        raise ValueError("names of no length")
    for at in range(0, len(names), length):
        kind, content = next(matrix.rest)
        if names[at : at + length].split(b"\0")[0].decode("latin-1") == keys[0]:
            return _numbers(_matrix(content, order), keys[1:], order) if kind == _MATRIX else None
    return None
