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
from .portable_code import portable_code, versions

_RUNTIME = Path(__file__).with_name("runtime.c")


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
        code, declared = _sources()
    except ImportError as error:
        raise InputError(
            f"the kernels cannot be compiled: {error}: install the extra dev"
        ) from error
    return [_library(one, code, declared, cache_folder) for one in MACHINES[platform]]


@cache
def _sources() -> tuple[str, str]:
    """The kernels, and the C around them."""
    chosen = versions()
    return portable_code(chosen), _RUNTIME.read_text(encoding="utf-8") + entries(chosen)


def _library(machine: Machine, code: str, declared: str, cache_folder: Path) -> Path:
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
    _zig(folder, *common, *kernels, "-o", "kernels.o")
    _zig(folder, *common, *around, "-o", "entries.o")
    whole = ["-Wl,-z,defs"] if "linux" in machine.triple else []  # elsewhere the linker insists
    objects = ["kernels.o", "entries.o", "-o", f"partial-{machine.name}"]
    _zig(folder, *common, "-shared", "-s", *whole, *objects)
    (folder / f"partial-{machine.name}").replace(made)
    return made


def _zig(folder: Path, *arguments: str) -> None:
    command = [sys.executable, "-m", "ziglang", "cc", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = [
            line for line in done.stderr.splitlines() if "error" in line or "No module" in line
        ]
        raise InputError(f"the kernels cannot be compiled: {(lines or ['zig failed'])[0]}")
