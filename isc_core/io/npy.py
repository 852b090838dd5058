"""Reading NumPy files (.npy, .npz) from untrusted sources.

Problem: `numpy.load` trusts the header: it allocates the claimed shape before it checks that the
file has as much data, and unpacks an archive's member of any size. Here shape, dtype and size are
first checked against the data and against `Limits`.

Citation: NumPy Enhancement Proposal 1, "A simple file format for NumPy arrays" (2007),
https://numpy.org/neps/nep-0001-npy-format.html; PKWARE, "APPNOTE.TXT - .ZIP File Format
Specification", version 6.3.10 (2022).

Limits: arrays of numbers, Booleans and strings; no objects (which are pickles), no structured
dtypes. Members are stored or deflated.
"""

import io
import math
import tokenize
import warnings
import zipfile
import zlib
from pathlib import Path

import numpy as np

from ..errors import InputError
from .limits import DEFAULT_LIMITS, Limits
from .memory import is_exhausted, memory_error
from .regular_files import read_regular

ARRAY, ARCHIVE = b"\x93NUMPY", b"PK"
KINDS = "fiub"
_ENCRYPTED = 0x1
# Errors of the parser for the literal in a header that is nested, broken or not a dtype.
_PARSING_ERRORS = (
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    SyntaxError,
    OverflowError,
    RecursionError,
    MemoryError,
    tokenize.TokenError,
)
_UNPACKING_ERRORS = (
    ValueError,
    KeyError,
    OSError,
    EOFError,
    OverflowError,
    RuntimeError,
    MemoryError,
    zipfile.BadZipFile,
    zlib.error,
)


def read_array(path: Path, limits: Limits = DEFAULT_LIMITS) -> np.ndarray:
    """Read a `.npy` file.

    Parameters
    ----------
    path : Path
    limits : Limits

    Returns
    -------
    ndarray
        Writable.

    Raises
    ------
    InputError
        If the file is absent, damaged, or not of plain numbers.
    """
    return parse_array(_bytes(path, limits), str(path), limits=limits).copy()


def read_arrays(path: Path, limits: Limits = DEFAULT_LIMITS) -> dict[str, np.ndarray]:
    """Read a `.npz` file.

    Parameters
    ----------
    path : Path
    limits : Limits

    Returns
    -------
    dict of str to ndarray
        Read-only.

    Raises
    ------
    InputError
        If the file is absent, or as `parse_arrays`.
    """
    return parse_arrays(_bytes(path, None), str(path), limits)


def parse_array(
    data: bytes, name: str, kinds: str = KINDS, limits: Limits = DEFAULT_LIMITS
) -> np.ndarray:
    """Parse the bytes of a `.npy` file.

    Parameters
    ----------
    data : bytes
    name : str
        Prefix of the error message.
    kinds : str
        Permitted dtype kinds, as NumPy's letters.
    limits : Limits

    Returns
    -------
    ndarray
        A view of `data`.

    Raises
    ------
    InputError
        If the bytes are damaged, truncated, or of another type.
    """
    try:
        shape, by_columns, kind, start = array_header(data)
    except ValueError as error:
        raise InputError(
            f"{name} is not a readable array (it is damaged): save it again with numpy.save"
        ) from error
    if (
        kind.kind not in kinds
        or kind.hasobject
        or kind.subdtype is not None
        or not 0 < kind.itemsize <= len(data)
    ):
        what = "objects" if kind.hasobject else str(kind)[:40]
        raise InputError(
            f"{name} is not a readable array of numbers but of {what}: save plain numbers with "
            "numpy.save"
        )
    count = math.prod(shape)
    if min(shape, default=0) < 0 or len(shape) > 8 or count * kind.itemsize > len(data) - start:
        raise InputError(
            f"{name} is not a readable array (it is damaged or cut short): save it again with "
            "numpy.save"
        )
    limits.check_unpacked(name, count * kind.itemsize, len(data))
    if count == 0:
        return np.zeros([min(n, 1 << 20) for n in shape], kind)
    return np.frombuffer(data, kind, count, start).reshape(shape, order="F" if by_columns else "C")


def parse_arrays(data: bytes, name: str, limits: Limits = DEFAULT_LIMITS) -> dict[str, np.ndarray]:
    """Parse the bytes of a `.npz` file.

    Parameters
    ----------
    data : bytes
    name : str
        Prefix of the error message.
    limits : Limits

    Returns
    -------
    dict of str to ndarray
        Read-only; strings too.

    Raises
    ------
    InputError
        If the bytes are damaged, of another type, or unpack to more than `limits`.
    """
    needed = len(data)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            plain = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
            if any(
                m.flag_bits & _ENCRYPTED
                or m.compress_type not in plain
                or not m.filename.endswith(".npy")
                for m in members
            ):
                raise ValueError("not an archive of arrays")
            size = sum(member.file_size for member in members)
            limits.check_unpacked(name, size, len(data))
            needed += size
            unpacked = {
                member.filename.removesuffix(".npy"): archive.read(member) for member in members
            }
    except InputError:
        raise
    except _UNPACKING_ERRORS as error:
        if is_exhausted(error):
            raise memory_error(f"{name}: its arrays", needed, "write smaller ones") from error
        raise InputError(
            f"{name} is damaged or not an archive of NumPy arrays: write it again"
        ) from error
    return {
        key: parse_array(content, f"{name} ({key})"[:400], KINDS + "U", limits)
        for key, content in unpacked.items()
    }


def array_header(data: bytes) -> tuple[tuple[int, ...], bool, np.dtype, int]:
    """Parse the header of a `.npy` file.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    shape : tuple of int
    fortran_order : bool
    dtype : dtype
    start : int
        Offset of the first value.

    Raises
    ------
    ValueError
        If the bytes do not begin with such a header.
    """
    stream = io.BytesIO(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about headers of old versions
            version = np.lib.format.read_magic(stream)
            if version not in ((1, 0), (2, 0)):
                raise ValueError("a header of an unknown version")
            read = (
                np.lib.format.read_array_header_1_0
                if version == (1, 0)
                else np.lib.format.read_array_header_2_0
            )
            shape, by_columns, kind = read(stream)
    except _PARSING_ERRORS as error:
        raise ValueError("no header of an array") from error
    return shape, by_columns, kind, stream.tell()


def _bytes(path: Path, limits: Limits | None) -> bytes:
    try:
        return read_regular(path, limits, "use a file of numpy.save")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
