"""`python -m blender_addon.packaging.kernels.replay windows-x64`: run another platform's library.

Problem: a library is made for systems that are not at hand. Wine and QEMU run its code, but no
Python for these systems is needed: a small program in C (`replay.c`) loads the library as Python
would, and repeats calls that were recorded here, with the same bytes in its arrays.

Layout of the calls: their number; for each the symbol, the number of values, and for each value 17
integers (`record` below), for an array followed by its memory. Of the outcomes: for each call
status, result, and the memory of each array. All integers have 64 bits.

Limits: what the system itself does, with Python's ctypes or a signature on the file, is not seen.
Functions of the C library (exp, log) differ in their last digits between systems, and so do sums of
products, where one processor rounds once and the other twice.
"""

import argparse
import shutil
import struct
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.numerics.kernel_library import open_library
from isc_core.numerics.kernel_types import Array, Scalar

from .build import MACHINES, Machine, c_text, libraries, libraries_for, run, zig
from .calls import Call, recorded_calls
from .entries import C_TYPES
from .portable_code import Version, versions

HERE = "linux-x64"
EMULATORS: dict[str, tuple[str, ...]] = {
    HERE: (),
    "windows-x64": ("wine",),
    "linux-arm64": ("qemu-aarch64-static", "-L", "/usr/aarch64-linux-gnu"),
    "macos-arm64": ("qemu-aarch64-static", "-L", "/usr/aarch64-linux-gnu"),
}
# Nothing here runs macOS: its kernels are compiled for another system on the same processor.
_STAND_INS = {"macos-arm64": "aarch64-linux-gnu.2.28"}
_SINGLE, _DOUBLE = 1e-4, 1e-9  # differences that rounding explains
_NAME, _MOST, _AXES = 96, 48, 5  # bytes of a symbol, values of a call, axes of an array


@dataclass(frozen=True)
class Difference:
    """How far the outcomes of a version's calls are from those here.

    Attributes
    ----------
    version : Version
    exact : bool
        Whether all bytes are equal.
    relative : float
        The largest difference in an array over the largest value in it; infinite if a call failed.
    """

    version: Version
    exact: bool
    relative: float

    @property
    def agrees(self) -> bool:
        """Whether it is no more than what rounding explains."""
        single = any(one.code == "f4" for one in self.version.signature.flat)
        return self.relative <= (_SINGLE if single else _DOUBLE)


def machines_of(platform: str) -> list[Machine]:
    """Return what the kernels of a platform are compiled for when they are run here.

    Parameters
    ----------
    platform : str

    Returns
    -------
    list of Machine
    """
    return [
        replace(one, name="kernels-stand-in.so", triple=_STAND_INS[platform])
        if platform in _STAND_INS
        else one
        for one in MACHINES[platform]
    ]


def replay(
    library: Path, machine: Machine, emulator: tuple[str, ...], calls: list[Call]
) -> list[Difference]:
    """Repeat calls on a library, and compare what comes out.

    Parameters
    ----------
    library : Path
    machine : Machine
        What the library is compiled for.
    emulator : tuple of str
        Command that runs its programs; () if this system does.
    calls : list of Call
        Recorded here.

    Returns
    -------
    list of Difference
        One for each version.

    Raises
    ------
    InputError
        If the emulator is not installed, or the library cannot be loaded.
    """
    if emulator and shutil.which(emulator[0]) is None:
        raise InputError(
            f"{emulator[0]} is not installed: it runs the library for {library.suffix}"
        )
    with tempfile.TemporaryDirectory(prefix="isc-replay-") as name:
        folder = Path(name)
        chosen = list({call.version.symbol: call.version for call in calls}.values())
        (folder / "replay.c").write_text(_program(chosen), encoding="utf-8")
        (folder / "calls").write_bytes(_written(calls))
        shutil.copy(library, folder / library.name)
        zig(folder, "-target", machine.triple, "-O1", "replay.c", "-o", "replay.exe")
        # A name without a folder would be looked for among the system's libraries.
        done = run([*emulator, "./replay.exe", f"./{library.name}", "calls", "outcomes"], folder)
        if done.returncode:
            raise InputError(f"{library.name}: {(done.stderr.strip() or 'it crashed')[-200:]}")
        return _differences(calls, (folder / "outcomes").read_bytes())


def _program(chosen: list[Version]) -> str:
    """The program, with a caller for each version."""
    structures = (
        f"enum {{ NAME = {_NAME}, MOST = {_MOST}, AXES = {_AXES} }};\n"
        "typedef union { int64_t i8; float f4; double f8; uint8_t b1; } number;\n"
        "typedef struct {\n"
        "    int64_t kind, size, contiguous, offset, length;\n"  # kind 0: a number, in its place
        "    number number;\n"
        "    int64_t axes, shape[AXES], strides[AXES];\n"
        "} record;\n"
        "typedef struct { record record; char *memory; element elements; array array; } value;\n"
    )
    callers = "".join(_caller(one) for one in chosen)
    listed = "".join(f'    {{"{one.symbol}", call_{one.symbol}}},\n' for one in chosen)
    return (
        f"{c_text('arrays.h')}{structures}{callers}"
        "static const struct {\n"
        "    const char *name;\n"
        "    int (*call)(void *, void *, const value *);\n"
        f"}} callers[] = {{\n{listed}}};\n"
        f"{c_text('replay.c')}"
    )


def _caller(version: Version) -> str:
    """A function that calls one version with the types that ctypes uses."""
    types = version.signature.flat
    declared = ", ".join(
        "const array *" if isinstance(one, Array) else C_TYPES[one.code] for one in types
    )
    passed = ", ".join(
        f"&v[{k}].array" if isinstance(one, Array) else f"v[{k}].record.number.{one.code}"
        for k, one in enumerate(types)
    )
    return (
        f"static int call_{version.symbol}(void *function, void *result, const value *v)\n"
        f"{{ return ((int (*)(void *, {declared}))function)(result, {passed}); }}\n"
    )


def _written(calls: list[Call]) -> bytes:
    parts = [struct.pack("<q", len(calls))]
    for call in calls:
        types = call.version.signature.flat
        parts.append(struct.pack(f"<{_NAME}sq", call.version.symbol.encode(), len(types)))
        for kind, value in zip(types, call.before, strict=True):
            parts += _number(kind, value) if isinstance(kind, Scalar) else _array(value)
    return b"".join(parts)


def _number(kind: Scalar, value: Any) -> list[bytes]:
    bits = np.array(value, kind.code).tobytes().ljust(8, b"\0")
    return [struct.pack(f"<5q8s{1 + 2 * _AXES}q", 0, 0, 0, 0, 0, bits, *[0] * (1 + 2 * _AXES))]


def _array(value: np.ndarray) -> list[bytes]:
    memory: Any = value.base
    offset = value.__array_interface__["data"][0] - memory.__array_interface__["data"][0]
    padding = [0] * (_AXES - value.ndim)
    head = struct.pack(
        f"<5q8s{1 + 2 * _AXES}q",
        ord(value.dtype.kind),
        value.itemsize,
        value.flags.c_contiguous,
        offset,
        memory.nbytes,
        b"",
        value.ndim,
        *value.shape,
        *padding,
        *value.strides,
        *padding,
    )
    return [head, memory.tobytes()]


def _differences(calls: list[Call], outcomes: bytes) -> list[Difference]:
    found: dict[str, Difference] = {}
    place = 0
    for call in calls:
        status, bits = struct.unpack_from("<q8s", outcomes, place)
        place += 16
        pairs = []
        if call.version.signature.result:
            code = call.version.signature.result.code
            pairs.append((np.frombuffer(bits, code), np.array([call.result], code)))
        for value in call.after:
            if isinstance(value, np.ndarray):
                memory: Any = value.base
                size = memory.nbytes
                got = np.frombuffer(outcomes, value.dtype, size // value.itemsize, place)
                pairs.append((got, memory.view(value.dtype)))
                place += size
        exact = status == 0 and all(got.tobytes() == want.tobytes() for got, want in pairs)
        relative = max((_relative(*pair) for pair in pairs), default=0.0) if status == 0 else np.inf
        symbol = call.version.symbol
        known = found.get(symbol, Difference(call.version, exact, relative))
        found[symbol] = Difference(
            call.version, exact and known.exact, max(relative, known.relative)
        )
    return list(found.values())


def _relative(got: np.ndarray, want: np.ndarray) -> float:
    if not np.array_equal(np.isfinite(got), np.isfinite(want)):
        return np.inf
    finite = np.isfinite(want)
    have, should = got[finite].astype(float), want[finite].astype(float)
    scale = np.abs(should).max(initial=0)
    off = np.abs(have - should).max(initial=0)
    return float(off / scale) if scale else float(off)


def main(arguments: list[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : list of str, optional
        Arguments; those of the process if None.

    Returns
    -------
    int
        Exit code: 0, 1 if results differ by more than rounding explains, 2 after one line with the
        error.
    """
    parser = argparse.ArgumentParser(
        prog="python -m blender_addon.packaging.kernels.replay",
        description="Repeat calls of every kernel on another platform's library, and compare.",
    )
    parser.add_argument("platform", choices=EMULATORS)
    parser.add_argument(
        "--libraries",
        type=Path,
        default=Path("build/wheels/kernels"),
        metavar="DIR",
        help="folder of compiled kernels (default: %(default)s)",
    )
    options = parser.parse_args(arguments)
    try:
        return 0 if _compared(options.platform, options.libraries) else 1
    except InputError as error:
        print(f"replay: {error}", file=sys.stderr)
        return 2


def _compared(platform: str, folder: Path) -> bool:
    opened = [one for one in map(open_library, libraries_for(HERE, folder)) if one is not None]
    if not opened:
        raise InputError(f"calls are recorded on {HERE} alone")
    calls = recorded_calls(opened[-1], versions())
    good = True
    machines = machines_of(platform)
    for path, machine in zip(libraries(machines, folder), machines, strict=True):
        differences = replay(path, machine, EMULATORS[platform], calls)
        exact = sum(one.exact for one in differences)
        print(f"{path.name}: {len(differences)} functions, {exact} with equal bytes")
        for one in sorted(differences, key=lambda one: -one.relative):
            if not one.exact:
                print(f"  {one.relative:8.1e}  {one.version.symbol}")
        good &= all(one.agrees for one in differences)
    return good


if __name__ == "__main__":
    sys.exit(main())
