"""NumPy files (.npy, .npz): reading from untrusted sources, and writing archives.

Problem: `numpy.load` trusts the header: it allocates the claimed shape before it checks that the
file has as much data, and unpacks an archive's member of any size. Here shape, dtype and size are
first checked against the data and against `Limits`.

Stored members are not copied: their arrays are views of the file's bytes. NumPy computes faster
with aligned values, so archives are written with every array at a multiple of 64 bytes, by a field
of zeros in the member's local header, as the Android tool zipalign does; other programs ignore it.

Citation: NumPy Enhancement Proposal 1, "A simple file format for NumPy arrays" (2007),
https://numpy.org/neps/nep-0001-npy-format.html; PKWARE, "APPNOTE.TXT - .ZIP File Format
Specification", version 6.3.10 (2022).

Limits: arrays of numbers, Booleans and strings; no objects (which are pickles), no structured
dtypes. Members are stored or deflated.
"""

import io
import math
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np

from ..errors import InputError
from .limits import DEFAULT_LIMITS, Limits
from .memory import is_exhausted, memory_error
from .regular_files import read_regular

ARRAY, ARCHIVE = b"\x93NUMPY", b"PK"
KINDS = "fiub"
_ENCRYPTED = 0x1
_LOCAL, _LOCAL_SIZE = b"PK\x03\x04", 30  # the local header of a member, before its name
_LARGE_FIELD = 20  # bytes of the field with sizes of 64 bits
_ALIGNMENT = 64
_PADDING = 0xD935  # identifier of a field that aligns the member
_MOST_HEADER = 1 << 16  # bytes; NumPy refuses much shorter headers of arrays
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


def write_archive(
    file: IO[bytes], arrays: Mapping[str, np.ndarray], *, compressed: bool = False
) -> None:
    """Write a `.npz` file; equal arrays give equal bytes.

    Parameters
    ----------
    file : binary file
        At its beginning.
    arrays : mapping of str to ndarray
    compressed : bool, optional
        Whether to deflate them.
    """
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy")
            member.compress_type = method
            if not compressed:
                header = _LOCAL_SIZE + len(member.filename.encode()) + _LARGE_FIELD
                member.extra = _padding(file.tell() + header)
            with archive.open(member, "w", force_zip64=True) as written:
                np.lib.format.write_array(written, np.asanyarray(array), allow_pickle=False)


def _padding(start: int) -> bytes:
    """The field of zeros that aligns the data of a member, which begin at `start` without it."""
    size = 4 + -(start + 4) % _ALIGNMENT
    return struct.pack("<HH", _PADDING, size - 4).ljust(size, b"\0")


def parse_array(
    data: bytes | memoryview, name: str, kinds: str = KINDS, limits: Limits = DEFAULT_LIMITS
) -> np.ndarray:
    """Parse the bytes of a `.npy` file.

    Parameters
    ----------
    data : bytes or memoryview
    name : str
        Prefix of the error message.
    kinds : str
        Permitted dtype kinds, as NumPy's letters.
    limits : Limits

    Returns
    -------
    ndarray
        A view of `data`, or a copy if its values would not be aligned.

    Raises
    ------
    InputError
        If the bytes are damaged, truncated, or of another type.
    """
    try:
        shape, by_columns, kind, start = array_header(bytes(data[:_MOST_HEADER]))
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
    values = np.frombuffer(data, kind, count, start)
    if not values.flags.aligned:
        values = values.copy()
        values.flags.writeable = False
    return values.reshape(shape, order="F" if by_columns else "C")


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
            needed += sum(m.file_size for m in members if m.compress_type != zipfile.ZIP_STORED)
            unpacked = {
                member.filename.removesuffix(".npy"): _unpacked(archive, member, data)
                for member in members
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


def _unpacked(archive: zipfile.ZipFile, member: zipfile.ZipInfo, data: bytes) -> bytes | memoryview:
    """The content of a member of the archive `data`."""
    if member.compress_type != zipfile.ZIP_STORED:
        return archive.read(member)
    start = member.header_offset + _LOCAL_SIZE
    header = data[member.header_offset : start]
    if len(header) < _LOCAL_SIZE or not header.startswith(_LOCAL):
        raise zipfile.BadZipFile("no header of a member")
    start += sum(struct.unpack_from("<HH", header, 26))
    content = memoryview(data)[start : start + member.file_size]
    if len(content) != member.file_size or zlib.crc32(content) != member.CRC:
        raise zipfile.BadZipFile("a member is damaged")
    return content


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
