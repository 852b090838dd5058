"""Make the library for a platform, on any other, with the C compiler of Zig.

Libraries are kept by what they are made from, so that the zips of a platform for several versions
of Python are built from one.
"""

import hashlib
import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.numerics.kernel_library import source_digest

from .entries import entries
from .portable_code import Version, portable_code, source_names, versions

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
    "macos-arm64": (Machine("kernels-arm64.dylib", "aarch64-macos.13.0", "apple_m1"),),
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
    return libraries(MACHINES.get(platform, ()), cache_folder)


def libraries(machines: Sequence[Machine], cache_folder: Path) -> list[Path]:
    """Return the libraries of some machines, making those that are missing.

    Parameters
    ----------
    machines : sequence of Machine
    cache_folder : Path
        Folder of libraries that were made.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If Numba or Zig is not installed, or compiling fails.
    """
    if not machines:
        return []
    try:
        folder = cache_folder / _origin()
        if all((folder / one.name).is_file() for one in machines):
            return [folder / one.name for one in machines]
        sources = _kept_sources(folder)
    except ImportError as error:
        raise InputError(
            f"the kernels cannot be compiled: {error}: install the extra dev"
        ) from error
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # of processes of the compiler
        return list(pool.map(lambda one: library(one, *sources, folder), machines))


def _origin() -> str:
    """A name for all that libraries are made from."""
    digest = hashlib.sha256()
    for package in ("numba", "ziglang"):
        digest.update(f"{package} {version(package)}\0".encode())
    for name in ("arrays.h", "build.py", "entries.py", "portable_code.py", "runtime.c"):
        digest.update((_C_FOLDER / name).read_bytes())
    digest.update(source_digest(source_names()).encode())
    return digest.hexdigest()[:16]


def _kept_sources(folder: Path) -> tuple[str, str]:
    """What all libraries of a folder are compiled from; Numba needs half a minute for it."""
    kept = folder / "kernels.ll", folder / "entries.c"
    if not kept[1].is_file():
        folder.mkdir(parents=True, exist_ok=True)
        for path, text in zip(kept, sources_of(versions()), strict=True):
            with new_file(path) as partial:
                partial.write_text(text, encoding="utf-8")
    return kept[0].read_text(encoding="utf-8"), kept[1].read_text(encoding="utf-8")


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
    names = source_names()
    origin = f'#define SOURCES "{" ".join([source_digest(names), *names])}"\n'
    around = c_text("arrays.h") + origin + c_text("runtime.c") + entries(chosen)
    return portable_code(chosen), around


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


def library(machine: Machine, code: str, declared: str, folder: Path) -> Path:
    """Make a library, unless the folder has it.

    Parameters
    ----------
    machine : Machine
    code, declared : str
        See `sources_of`.
    folder : Path
        Of libraries that are made from the same sources.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If Zig is not installed, or compiling fails.
    """
    made = folder / machine.name
    if made.is_file():
        return made
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix="parts-", dir=folder) as parts:
        _compile(machine, code, declared, Path(parts))
        (Path(parts) / machine.name).replace(made)
    return made


def _compile(machine: Machine, code: str, declared: str, place: Path) -> None:
    """Make a library in a folder of its own."""
    (place / "kernels.ll").write_text(code, encoding="utf-8")
    (place / "entries.c").write_text(declared, encoding="utf-8")
    common = ["-target", machine.triple, "-O3", "-g0", "-fPIC"]
    kernels = [f"-mcpu={machine.processor}", "-Wno-override-module", "-c", "kernels.ll"]
    # The entries find out whether the processor is good enough for the kernels: on any.
    around = ["-fvisibility=hidden", f"-DLEVEL={machine.level}", "-c", "entries.c"]
    zig(place, *common, *kernels, "-o", "kernels.o")
    zig(place, *common, *around, "-o", "entries.o")
    whole = ["-Wl,-z,defs"] if "linux" in machine.triple else []  # elsewhere the linker insists
    # The file's name is also in it, hence the folder.
    zig(place, *common, "-shared", "-s", *whole, "kernels.o", "entries.o", "-o", machine.name)


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
