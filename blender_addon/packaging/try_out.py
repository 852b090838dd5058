"""`python -m blender_addon.packaging.try_out ZIP --bpy 4.5.15`: install and test a zip in a clean
environment with only that `bpy`.

The environment is created once, in build/, with the Python that runs this. Blender's user folder is
new each time. `installation` contains the test itself. Only the bpy wheel is downloaded, by pip.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from isc_core.errors import InputError

SCRIPT = Path(__file__).with_name("installation.py")
_SECONDS = 1800


def main(arguments: list[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : list of str, optional
        Arguments; those of the process if None.

    Returns
    -------
    int
        Exit code: 0, 1 if the test fails, 2 after one line with the error.
    """
    parser = argparse.ArgumentParser(
        prog="python -m blender_addon.packaging.try_out",
        description="Test a zip of the extension in a clean environment.",
    )
    parser.add_argument("archive", type=Path, metavar="ZIP", help="zip of the extension")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument(
        "--bpy",
        metavar="VERSION",
        help="version of Blender, for example 4.5.15; its environment is created in build/",
    )
    which.add_argument("--python", type=Path, metavar="PATH", help="Python with the bpy module")
    options = parser.parse_args(arguments)
    try:
        python = options.python or environment(options.bpy)
        done = try_out(options.archive, python)
    except InputError as error:
        print(f"extension: {error}", file=sys.stderr)
        return 2
    print(done.stdout[-20000:], done.stderr[-20000:], sep="\n")
    return 1 if done.returncode else 0


def environment(version: str, folder: Path = Path("build/environments")) -> Path:
    """Create a virtual environment with a bpy module, unless it exists.

    Parameters
    ----------
    version : str
        Version of bpy.
    folder : Path, optional
        Parent folder of environments.

    Returns
    -------
    Path
        The environment's Python.

    Raises
    ------
    InputError
        If pip cannot install that version.
    """
    place = folder.resolve() / f"bpy-{version}"
    python = place / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    if not python.exists() or _fails(python, "import bpy"):
        subprocess.run([sys.executable, "-m", "venv", "--clear", str(place)], check=True)
        call = [
            str(python),
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            f"bpy=={version}",
        ]
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        if done.returncode:
            raise InputError(
                f"cannot install bpy {version} for Python {sys.version.split()[0]}: "
                f"{done.stderr.strip().splitlines()[-1]}"
            )
    return python


def _fails(python: Path, code: str) -> bool:
    done = subprocess.run([str(python), "-c", code], capture_output=True, check=False)
    return done.returncode != 0


def try_out(
    archive: Path, python: Path, result: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run `installation` with a new user folder.

    Parameters
    ----------
    archive : Path
        The zip.
    python : Path
        Python with the bpy module.
    result : Path, optional
        Result folder to import instead of decomposing photos.

    Returns
    -------
    subprocess.CompletedProcess
        Exit code and output.

    Raises
    ------
    InputError
        If the zip does not exist.
    """
    if not archive.is_file():
        raise InputError(f"{archive}: no such zip: build it with `make extension`")
    with tempfile.TemporaryDirectory(prefix="isc-extension-") as folder:
        user, work = Path(folder) / "user", Path(folder) / "work"
        user.mkdir()
        work.mkdir()
        clean = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PYTHON", "NUMBA", "BLENDER"))
        }
        variables = clean | {"BLENDER_USER_RESOURCES": str(user), "HOME": str(work)}
        command = [
            str(python),
            "-P",
            str(SCRIPT),
            str(archive.resolve()),
            str(work),
            *([] if result is None else [str(result)]),
        ]
        return subprocess.run(
            command,
            cwd=work,
            env=variables,
            capture_output=True,
            text=True,
            check=False,
            timeout=_SECONDS,
        )


if __name__ == "__main__":
    sys.exit(main())
