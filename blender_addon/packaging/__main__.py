"""`python -m blender_addon.packaging`: build the extension's zips, validate them with Blender, and
list their contents.
"""

import argparse
import sys
from pathlib import Path

from isc_core.errors import InputError

from .archive import archive_name, contents, listing, write_archive
from .kernels.build import libraries_for
from .targets import TARGETS, Target, chosen
from .validate import validate
from .wheels import wheels_for


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
        prog="python -m blender_addon.packaging",
        description="Build the zips of the Blender extension.",
    )
    names = ", ".join(target.name for target in TARGETS)
    parser.add_argument(
        "target",
        nargs="?",
        default="all",
        help=f"all, here (this machine and Python), or one of {names} (default: %(default)s)",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("dist"),
        metavar="DIR",
        help="folder for the zips (default: %(default)s)",
    )
    parser.add_argument(
        "--wheels",
        type=Path,
        default=Path("build/wheels"),
        metavar="DIR",
        help="folder for downloaded wheels (default: %(default)s)",
    )
    parser.add_argument("--offline", action="store_true", help="use downloaded wheels only")
    parser.add_argument(
        "--without-wheels",
        action="store_true",
        help="leave out wheels and compiled kernels, for a Blender whose Python has the packages",
    )
    options = parser.parse_args(arguments)
    try:
        for target in chosen(options.target):
            build(
                target,
                options.output,
                None if options.without_wheels else options.wheels,
                offline=options.offline,
            )
    except InputError as error:
        print(f"extension: {error}", file=sys.stderr)
        return 2
    return 0


def build(target: Target, output: Path, cache: Path | None, *, offline: bool = False) -> Path:
    """Build, validate and list one zip.

    Parameters
    ----------
    target : Target
        Platform and Python version.
    output : Path
        Folder of the zip.
    cache : Path or None
        Folder of downloaded wheels and compiled kernels; None leaves both out.
    offline : bool, optional
        Whether to use downloaded wheels only.

    Returns
    -------
    Path
        The zip.

    Raises
    ------
    InputError
        If a wheel is missing, the kernels cannot be compiled, a module cannot be shipped, or
        Blender rejects the zip.
    """
    wheels = [] if cache is None else wheels_for(target, cache, offline=offline)
    libraries = [] if cache is None else libraries_for(target.platform, cache / "kernels")
    path = output / archive_name(target)
    write_archive(path, contents(target, wheels, libraries))
    if validate(path):
        outcome = "validated by Blender"
    else:
        outcome = "not validated: the bpy module is not installed"
    print(*listing(path), f"  {outcome}", sep="\n", flush=True)
    return path


if __name__ == "__main__":
    sys.exit(main())
