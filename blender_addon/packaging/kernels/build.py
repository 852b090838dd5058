"""Make the library for a platform, on any other, with the C compiler of Zig.

A library is kept by the text that it is made from, so that the zips of a platform for several
versions of Python are built from one.
"""

import hashlib
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from isc_core.errors import InputError

from .entries import entries
from .portable_code import Version, portable_code, versions

_C_FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Machine:
    """What a library is compiled for.

    Attributes
    ----------
    name : str
        File name of the library.
    triple : str
        Processor, system and its oldest version, as Zig names them.
    processor : str
        Its level, as Zig names it.
    level : int
        The same for `runtime.c`.
    """

    name: str
    triple: str
    processor: str
    level: int = 0


MACHINES = {
    "linux-x64": tuple(
        Machine(f"kernels-x86-64-v{level}.so", "x86_64-linux-gnu.2.28", f"x86_64_v{level}", level)
        for level in (2, 3)
    ),
    "windows-x64": tuple(
        Machine(f"kernels-x86-64-v{level}.dll", "x86_64-windows-gnu", f"x86_64_v{level}", level)
        for level in (2, 3)
    ),
    "linux-arm64": (Machine("kernels-arm64.so", "aarch64-linux-gnu.2.28", "generic"),),
}


def libraries_for(platform: str, cache_folder: Path) -> list[Path]:
    """Return the libraries of a platform, making those that are missing.

    Parameters
    ----------
    platform : str
        Name of the platform in Blender's manifests.
    cache_folder : Path
        Folder of libraries that were made.

    Returns
    -------
    list of Path
        Empty for a platform that is not in `MACHINES`.

    Raises
    ------
    InputError
        If Numba or Zig is not installed, or compiling fails.
    """
    if platform not in MACHINES:
        return []
    try:
        sources = _all_sources()
    except ImportError as error:
        raise InputError(
            f"the kernels cannot be compiled: {error}: install the extra dev"
        ) from error
    return [library(one, *sources, cache_folder) for one in MACHINES[platform]]


@cache
def _all_sources() -> tuple[str, str]:
    return sources_of(versions())


def sources_of(chosen: list[Version]) -> tuple[str, str]:
    """Return what a library of some kernels is compiled from.

    Parameters
    ----------
    chosen : list of Version

    Returns
    -------
    code : str
        The kernels, in LLVM's notation.
    declared : str
        The C around them.
    """
    return portable_code(chosen), c_text("arrays.h") + c_text("runtime.c") + entries(chosen)


def c_text(name: str) -> str:
    """Return the text of a file in C beside this one.

    Parameters
    ----------
    name : str

    Returns
    -------
    str
    """
    return (_C_FOLDER / name).read_text(encoding="utf-8")


def library(machine: Machine, code: str, declared: str, cache_folder: Path) -> Path:
    """Return a library, made unless it was before.

    Parameters
    ----------
    machine : Machine
    code, declared : str
        See `sources_of`.
    cache_folder : Path
        Folder of libraries that were made.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If Zig is not installed, or compiling fails.
    """
    digest = hashlib.sha256(f"{machine}\0{code}\0{declared}".encode()).hexdigest()
    folder = cache_folder / digest[:16]
    made = folder / machine.name
    if made.is_file():
        return made
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "kernels.ll").write_text(code, encoding="utf-8")
    (folder / "entries.c").write_text(declared, encoding="utf-8")
    common = ["-target", machine.triple, "-O3", "-g0", "-fPIC"]
    kernels = [f"-mcpu={machine.processor}", "-Wno-override-module", "-c", "kernels.ll"]
    # The entries find out whether the processor is good enough for the kernels: on any.
    around = ["-fvisibility=hidden", f"-DLEVEL={machine.level}", "-c", "entries.c"]
    zig(folder, *common, *kernels, "-o", "kernels.o")
    zig(folder, *common, *around, "-o", "entries.o")
    whole = ["-Wl,-z,defs"] if "linux" in machine.triple else []  # elsewhere the linker insists
    # The file's name is also in it.
    partial = folder / "partial" / machine.name
    partial.parent.mkdir(exist_ok=True)
    objects = ["kernels.o", "entries.o", "-o", f"partial/{machine.name}"]
    zig(folder, *common, "-shared", "-s", *whole, *objects)
    partial.replace(made)
    return made


def zig(folder: Path, *arguments: str) -> None:
    """Run Zig's compiler for C.

    Parameters
    ----------
    folder : Path
        Folder to work in.
    *arguments : str

    Raises
    ------
    InputError
        If Zig is not installed, or compiling fails.
    """
    done = run([sys.executable, "-m", "ziglang", "cc", *arguments], folder)
    if done.returncode:
        lines = [
            line for line in done.stderr.splitlines() if "error" in line or "No module" in line
        ]
        raise InputError(f"the kernels cannot be compiled: {(lines or ['zig failed'])[0]}")


def run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command.

    Parameters
    ----------
    command : list of str
    folder : Path
        Folder to work in.

    Returns
    -------
    subprocess.CompletedProcess
    """
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
