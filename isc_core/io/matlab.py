"""Numeric variables of MATLAB files of version 5 to 7.

Problem: research data are distributed as MAT files from untrusted sources. SciPy reads them, but
unpacks any size that a file claims, and crashes on elements of unknown type. All elements are
checked before SciPy reads the file, the sizes of compressed ones against `Limits`.

Citation: The MathWorks, "MAT-File Format", R2023a (2023), chapter 1, "Level 5 MAT-File Format".

Limits: real matrices and fields of scalar structs; not version 4, nor 7.3 (HDF5).
"""

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from ..errors import InputError
from .limits import DEFAULT_LIMITS, Limits
from .memory import is_exhausted, memory_error
from .native_io import suppress_native_output
from .regular_files import read_regular

_HEADER = 128  # bytes
_MATRIX, _DEFLATED = 14, 15
_NUMERIC = {1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18}  # types of numbers and characters
_CONTAINERS = {1, 2, 3, 16, 17}  # array classes that contain matrices: cells, structs, objects
_MAX_DEPTH = 32
_READ_ERRORS = (
    MatReadError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    UnboundLocalError,
    NotImplementedError,
    struct.error,
    zlib.error,
    EOFError,
    OSError,
    OverflowError,
    MemoryError,
)


def read_matrix(path: Path, *keys: str, limits: Limits = DEFAULT_LIMITS) -> np.ndarray:
    """Read a real numeric variable, or a field of a struct.

    Parameters
    ----------
    path : Path
        The MAT file.
    *keys : str
        The variable's name, then the field's, and so on.
    limits : Limits
        Limits of the unpacked size.

    Returns
    -------
    ndarray, at least 2-D
        Of the variable's own class.

    Raises
    ------
    InputError
        If the file is absent, damaged, too large, of another version, or has no such numbers.
    """
    try:
        data = read_regular(path, limits, "use a MATLAB file")
    except OSError as error:
        raise InputError(
            f"cannot read {path} ({error.strerror}): is the data set complete?"
        ) from error
    if data.startswith(b"MATLAB 7.3"):
        raise InputError(f"{path} is a MATLAB 7.3 file: save it with '-v7' and try again")
    needed = len(data)
    try:
        needed += 2 * _check_elements(path, data, limits)
        with suppress_native_output():
            variables = loadmat(
                io.BytesIO(data), variable_names=keys[:1], mat_dtype=True, struct_as_record=True
            )
        value = _field(variables.get(keys[0]), keys[1:])
    except InputError:
        raise
    except _READ_ERRORS as error:
        if is_exhausted(error):
            raise memory_error(f"{path}: its matrices", needed, "save fewer of them") from error
        raise InputError(f"{path} is not a readable MATLAB file: fetch or save it again") from error
    if value is None:
        raise InputError(f"{path} has no '{'.'.join(keys)}': is it the file of the data set?")
    return value


def _field(value: object, keys: tuple[str, ...]) -> np.ndarray | None:
    for key in keys:
        if (
            not isinstance(value, np.ndarray)
            or value.size != 1
            or key not in (value.dtype.names or ())
        ):
            return None
        value = value[key].flat[0]
    if value is not None and (not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu"):
        raise ValueError("not a matrix of real numbers")
    return value


def _check_elements(path: Path, data: bytes, limits: Limits) -> int:
    """Reject elements that are unsafe for SciPy: of unknown type, truncated or too large.

    Returns their total unpacked size in bytes.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[_HEADER - 2 : _HEADER])
    if order is None:
        raise ValueError("no byte order mark")
    unpacked = 0
    for kind, content in _elements(data[_HEADER:], order):
        if kind == _DEFLATED:
            stream = zlib.decompressobj()
            start = stream.decompress(content, 8)
            size = struct.unpack(f"{order}II", start)[1]
            unpacked += size
            limits.check_unpacked(path, unpacked, len(data))
            inner = start + stream.decompress(stream.unconsumed_tail, size + 1)
            for inner_kind, inner_content in _elements(inner, order):
                _check_matrix(inner_kind, inner_content, order, 0)
        else:
            unpacked += len(content)
            _check_matrix(kind, content, order, 0)
    return unpacked


def _check_matrix(kind: int, content: bytes, order: str, depth: int) -> None:
    """Check the elements of a matrix, cell array or struct.

    SciPy dereferences a null pointer if the type of a numeric element is not numeric.
    """
    if (kind not in _NUMERIC and kind != _MATRIX) or depth > _MAX_DEPTH:
        raise ValueError(f"an element of type {kind} at depth {depth}")
    if kind == _MATRIX and content:
        array_class = struct.unpack_from(f"{order}I", content, 8)[0] & 0xFF
        for inner_kind, inner_content in _elements(content, order):
            if inner_kind == _MATRIX and array_class not in _CONTAINERS:
                raise ValueError("a matrix in place of numbers")
            _check_matrix(inner_kind, inner_content, order, depth + 1)


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and content of consecutive elements."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        start, after = at + 8, at + 8 + size + (-size % 8 if kind != _DEFLATED else 0)
        if kind >> 16:  # the content of a small element is in the tag
            kind, size, start, after = kind & 0xFFFF, kind >> 16, at + 4, at + 8
        if start + size > min(len(data), after):
            raise ValueError("an element is cut short")
        yield kind, data[start : start + size]
        at = after
