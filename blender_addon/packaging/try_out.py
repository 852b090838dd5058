"""`python -m blender_addon.packaging.try_out ZIP --bpy 4.5.15`: installs a zip in a fresh
environment that holds only that `bpy`.

The environment is made once, in build/, with the Python that runs this; Blender's user folder is a
new one each time. What is tried there stands in `installation`. The bpy wheel is fetched by pip;
nothing else is.
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
    """The command.

    Returns 0, 1 if something does not work, or 2 after one line about what was wrong.
    """
    parser = argparse.ArgumentParser(
        prog="python -m blender_addon.packaging.try_out",
        description="Try a zip out in a clean environment.",
    )
    parser.add_argument("archive", type=Path, metavar="ZIP", help="the extension's zip")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument(
        "--bpy",
        metavar="VERSION",
        help="the Blender to try, such as 4.5.15: an environment is made for it in build/",
    )
    which.add_argument("--python", type=Path, metavar="PATH", help="a Python that has bpy")
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
    """The Python of a virtual environment with that bpy and what it needs itself.

    Raises `InputError` if pip has none.
    """
    place = folder.resolve() / f"bpy-{version}"
    python = place / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    if (
        subprocess.run(
            [str(python), "-c", "import bpy"], capture_output=True, check=False
        ).returncode
        if python.exists()
        else True
    ):
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
                f"bpy {version} cannot be installed for {sys.version.split()[0]}: {done.stderr.strip().splitlines()[-1]}"
            )
    return python


def try_out(
    archive: Path, python: Path, result: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Runs `installation` with a new user folder; what it printed.

    `result`: see there. Raises `InputError` if there is no such zip.
    """
    if not archive.is_file():
        raise InputError(f"{archive}: there is no such zip; build it with `make extension`")
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
