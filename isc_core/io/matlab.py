"""Numeric variables of MATLAB files of version 5 to 7.

Problem: research data comes as MAT files, from anybody. SciPy reads them, but unpacks whatever size
a file claims. The sizes of all compressed elements are checked against `Limits` before SciPy sees
the file.

Citation: The MathWorks, "MAT-File Format", R2023a (2023), chapter 1, "Level 5 MAT-File Format".

Limits: real matrices and fields of scalar structs; not version 4, nor 7.3 (HDF5).
"""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from ..errors import InputError
from .limits import USUAL, Limits
from .native_io import suppress_native_output

_HEADER = 128  # bytes
_DEFLATED = 15
_DAMAGED = (
    MatReadError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    NotImplementedError,
    struct.error,
    zlib.error,
    EOFError,
    OSError,
    OverflowError,
    MemoryError,
)


def read_matrix(path: Path, *keys: str, limits: Limits = USUAL) -> np.ndarray:
    """Read a real numeric variable, or a field of a struct.

    Parameters
    ----------
    path : Path
        The MAT file.
    *keys : str
        The variable's name, then the field's, and so on.
    limits : Limits
        What the file may unpack to.

    Returns
    -------
    ndarray, at least 2-D
        Of the variable's own class.

    Raises
    ------
    InputError
        If the file is absent, damaged, too large, of another version, or holds no such numbers.
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
        _check_sizes(path, data, limits)
        with suppress_native_output():
            variables = loadmat(
                io.BytesIO(data), variable_names=keys[:1], mat_dtype=True, struct_as_record=True
            )
        value = _field(variables.get(keys[0]), keys[1:])
    except InputError:
        raise
    except _DAMAGED as error:
        raise InputError(f"{path} is not a readable MATLAB file: fetch or save it again") from error
    if value is None:
        raise InputError(f"{path} lacks '{'.'.join(keys)}': is it the file of the data set?")
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


def _check_sizes(path: Path, data: bytes, limits: Limits) -> None:
    """Refuse a file whose compressed elements claim to unpack to more than `limits` allow."""
    order = {b"IM": "<", b"MI": ">"}.get(data[_HEADER - 2 : _HEADER])
    if order is None:
        raise ValueError("no byte order mark")
    at = _HEADER
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if at + 8 + size > len(data):
            raise ValueError("an element is cut short")
        if kind == _DEFLATED:
            start = zlib.decompressobj().decompress(data[at + 8 : at + 8 + size], 8)
            limits.check_unpacked(path, struct.unpack(f"{order}II", start)[1], len(data))
        at += 8 + size
