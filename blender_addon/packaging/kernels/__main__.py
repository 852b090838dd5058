"""`python -m blender_addon.packaging.kernels`: compile the kernels into the source tree.

The libraries for this machine (or with `--all` those for all) are put where `isc_core` looks for
them: an editable installation then uses one, and a wheel that is built here contains them. Other
libraries there are removed.
"""

import argparse
import platform
import shutil
import sys
from pathlib import Path

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.numerics.kernel_library import FOLDER

from .build import MACHINES, libraries

_HERE = {
    ("Linux", "x86_64"): "linux-x64",
    ("Linux", "aarch64"): "linux-arm64",
    ("Windows", "AMD64"): "windows-x64",
    ("Darwin", "arm64"): "macos-arm64",
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : list of str, optional
        Arguments; those of the process if None.

    Returns
    -------
    int
        Exit code: 0, or 2 after one line with the error.
    """
    parser = argparse.ArgumentParser(
        prog="python -m blender_addon.packaging.kernels",
        description="Compile the kernels ahead of time.",
    )
    parser.add_argument("--all", action="store_true", help="for all machines, not only this one")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=FOLDER,
        metavar="DIR",
        help="folder for the libraries (default: where isc_core looks for them)",
    )
    parser.add_argument(
        "--cache",
        type=Path,
        default=Path("build/wheels/kernels"),
        metavar="DIR",
        help="folder of libraries that were made (default: %(default)s)",
    )
    options = parser.parse_args(arguments)
    here = _HERE.get((platform.system(), platform.machine()), "")
    wanted = list(MACHINES) if options.all else [here]
    machines = [one for name in wanted for one in MACHINES.get(name, ())]
    try:
        _put(libraries(machines, options.cache), options.output)
    except InputError as error:
        print(f"kernels: {error}", file=sys.stderr)
        return 2
    return 0


def _put(made: list[Path], folder: Path) -> None:
    """Copy libraries into a folder, each completely, and remove others."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in made:
        with new_file(folder / path.name) as partial:
            shutil.copyfile(path, partial)
    names = {path.name for path in made}
    for path in folder.glob("kernels*"):
        if path.name not in names:
            path.unlink()


if __name__ == "__main__":
    sys.exit(main())
