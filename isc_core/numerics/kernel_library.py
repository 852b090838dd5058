"""Kernels that were compiled ahead of time, called through ctypes.

Problem: a program that compiles its kernels has to include a compiler (200 MB for Numba and LLVM),
and compiles for 20 s at its first use; the result depends on the processor. The Blender extension,
wheels, and developers' trees contain a shared library of half a megabyte instead.

The library has one function for each kernel and version of its types. It receives arrays as Python
objects, checks their type, and reads address, shape and strides from the fields that are part of
NumPy's binary interface. A call releases the interpreter lock.

Arrays whose types or strides differ from the declared ones are copied before the call, and copied
back afterwards: slower, with the same result.

A library contains a digest of the source files of its kernels. It is used only if the digest
matches, so that code of another version is never run.

Limits: a library is for one system and one kind of processor. For x86-64 there are two: one uses
the x86-64-v3 instructions of processors since 2013, the other is for older ones.
"""

import ctypes
import hashlib
import platform
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from .kernel_types import Array, Group, Scalar, Signature

FOLDER = Path(__file__).with_name("compiled")
"""Folder of the libraries for all machines; the preferred one is the last by name."""
_PROCESSORS = {"x86_64": "x86-64", "amd64": "x86-64", "arm64": "arm64", "aarch64": "arm64"}
_SUFFIXES = {"win32": "dll", "darwin": "dylib"}
_CORE = FOLDER.parents[1]
_MATCH, _MISMATCH = 0, -1  # as in runtime.c


@cache
def shipped_library() -> "KernelLibrary | None":
    """Return the library for this machine; None if none was shipped or works on it."""
    from .kernel_check import passes  # imports kernels, which use this library

    # Windows may show a dialog when it loads a library for another system.
    processor = _PROCESSORS.get(platform.machine().lower(), "none")
    pattern = f"kernels-{processor}*.{_SUFFIXES.get(sys.platform, 'so')}"
    opened = map(open_library, sorted(FOLDER.glob(pattern), reverse=True))
    return next((one for one in opened if one is not None and passes(one)), None)


def open_library(path: Path) -> "KernelLibrary | None":
    """Load a library.

    Parameters
    ----------
    path : Path

    Returns
    -------
    KernelLibrary or None
        None if it is for another system, another processor, or other sources.
    """
    try:
        loaded = ctypes.CDLL(str(path))
        loaded.isc_sources.restype = ctypes.c_char_p
        digest, *names = loaded.isc_sources().decode().split()
        if not loaded.isc_processor_fits() or source_digest(names) != digest:
            return None
    except OSError:
        return None
    loaded.isc_set_array_class(ctypes.py_object(np.ndarray))
    return KernelLibrary(loaded)


def source_digest(names: Sequence[str]) -> str:
    """Return the digest of some files of `isc_core`.

    Parameters
    ----------
    names : sequence of str
        Paths inside `isc_core`, with forward slashes.

    Returns
    -------
    str
        SHA-256.

    Raises
    ------
    OSError
        If one cannot be read.
    """
    digest = hashlib.sha256()
    for name in names:
        digest.update((_CORE / name).read_bytes())
    return digest.hexdigest()


def symbol(function: Callable[..., Any], version: int) -> str:
    """Return the name of a kernel in the library.

    Parameters
    ----------
    function : callable
        The kernel's Python function.
    version : int
        Index of its signature.

    Returns
    -------
    str
        For example isc_sirfs_kernels_height_rows_forward_rows_0.
    """
    module = function.__module__.rpartition("isc_core.")[2]
    return f"isc_{module.replace('.', '_')}_{function.__name__}_{version}"


class _Boolean:
    """Converts a Boolean, also NumPy's."""

    @staticmethod
    def from_param(value: Any) -> ctypes.c_uint8:
        return ctypes.c_uint8(bool(value))


# (ctypes accepts Python's and NumPy's integers, and rejects fractions)
_SCALARS = {"i8": ctypes.c_int64, "f4": ctypes.c_float, "f8": ctypes.c_double, "b1": _Boolean}
_RESULTS: dict[str, Any] = {"i8": ctypes.c_int64, "f8": ctypes.c_double}


class KernelLibrary:
    """An open library.

    Parameters
    ----------
    loaded : ctypes.CDLL
    """

    def __init__(self, loaded: ctypes.CDLL) -> None:
        self._loaded = loaded

    def __contains__(self, function: Callable[..., Any]) -> bool:
        """Whether the library contains a kernel; newer kernels may be in new files."""
        return hasattr(self._loaded, symbol(function, 0))

    def kernel(
        self, function: Callable[..., Any], signatures: Sequence[Signature]
    ) -> Callable[..., Any]:
        """Return the compiled kernel.

        Parameters
        ----------
        function : callable
            The Python function.
        signatures : sequence of Signature
            One for each version.

        Returns
        -------
        callable
            Takes the arguments of the function. Raises MemoryError if its scratch memory cannot be
            allocated.
        """
        entries = self.entries(function, signatures)
        grouped = any(isinstance(one, Group) for one in signatures[0].arguments)

        def call(*values: Any) -> Any:
            flat = flattened(values) if grouped else values
            for entry in entries:
                fits, result = entry(flat)
                if fits:
                    return result
            return entries[-1].on_copies(flat)

        return call

    def entries(
        self, function: Callable[..., Any], signatures: Sequence[Signature]
    ) -> list["_Entry"]:
        """Return the versions of a compiled kernel.

        Parameters
        ----------
        function : callable
            The Python function.
        signatures : sequence of Signature
            One for each version.

        Returns
        -------
        list
            Each takes the `flattened` arguments, and returns whether their types match, and the
            result.
        """
        return [
            _Entry(self._loaded[symbol(function, version)], signature)
            for version, signature in enumerate(signatures)
        ]


def flattened(values: Sequence[Any]) -> list[Any]:
    """Replace tuples by their fields.

    Parameters
    ----------
    values : sequence
        Arguments of a kernel.

    Returns
    -------
    list
    """
    flat: list[Any] = []
    for value in values:
        if isinstance(value, tuple):
            flat.extend(value)
        else:
            flat.append(value)
    return flat


class _Entry:
    """One version of a kernel.

    Parameters
    ----------
    native : ctypes function
    signature : Signature
    """

    def __init__(self, native: Any, signature: Signature) -> None:
        self._native, self._types = native, signature.flat
        self._result = _RESULTS[signature.result.code] if signature.result else None
        native.restype = ctypes.c_int
        native.argtypes = (
            ctypes.c_void_p,
            *(_SCALARS[t.code] if isinstance(t, Scalar) else ctypes.py_object for t in self._types),
        )

    def __call__(self, flat: Sequence[Any]) -> tuple[bool, Any]:
        """Whether the types match, and the result."""
        if self._result is None:
            status, result = self._native(None, *flat), None
        else:
            written = self._result()
            status, result = self._native(ctypes.byref(written), *flat), written.value
        if status not in (_MATCH, _MISMATCH):
            raise MemoryError("no memory for a compiled kernel")
        return status == _MATCH, result

    def on_copies(self, flat: Sequence[Any]) -> Any:
        """Call with copies of all arrays, copy these back, and return the result."""
        copies = [
            np.array(value, kind.code, order="C") if isinstance(kind, Array) else value
            for value, kind in zip(flat, self._types, strict=True)
        ]
        fits, result = self(copies)
        if not fits:
            raise TypeError("a compiled kernel was called with arrays of other dimensions")
        for value, copy in zip(flat, copies, strict=True):
            if isinstance(value, np.ndarray) and value.flags.writeable:
                value[...] = copy
        return result
