"""`python -m blender_addon.packaging`: builds the extension's zips, checks them with Blender's
validator and lists what is in them.
"""

import argparse
import sys
from pathlib import Path

from isc_core.errors import InputError

from .archive import archive_name, contents, listing, write_archive
from .targets import TARGETS, Target, chosen
from .validate import validate
from .wheels import wheels_for


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns 0, or 2 after one line about what was wrong."""
    parser = argparse.ArgumentParser(
        prog="python -m blender_addon.packaging", description="Build the Blender extension's zips."
    )
    names = ", ".join(target.name for target in TARGETS)
    parser.add_argument(
        "target",
        nargs="?",
        default="all",
        help=f"all, here (this machine and Python) or one of {names} (default: all)",
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
        help="where wheels are kept (%(default)s)",
    )
    parser.add_argument(
        "--offline", action="store_true", help="take the wheels that are there, fetch none"
    )
    parser.add_argument(
        "--without-wheels",
        action="store_true",
        help="for a Blender whose Python has the packages already",
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
    """Builds one zip in the folder `output`, checks and lists it. `cache`: the folder of wheels;
    None leaves them out.

    Raises `InputError` if a wheel cannot be had, a module cannot be shipped, or Blender refuses the
    zip.
    """
    wheels = [] if cache is None else wheels_for(target, cache, offline=offline)
    path = output / archive_name(target)
    write_archive(path, contents(target, wheels))
    checked = validate(path)
    print(
        "\n".join(
            [
                *listing(path),
                "  passed Blender's validator"
                if checked
                else "  not validated: the bpy module is not here",
            ]
        ),
        flush=True,
    )
    return path


if __name__ == "__main__":
    sys.exit(main())
