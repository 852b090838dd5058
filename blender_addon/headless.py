"""Photos become .blend files and renders without a window.

    blender -b -P blender_addon/headless.py -- photo.png --mask mask.png -o out.blend --render
    out.png python -m blender_addon.headless photo.png --mask mask.png -o out.blend --render out.png

The first form works with this file in the source tree and in an installed extension; the second
wants the `bpy` module. What stands behind `--` is read by `command_line`; exit codes are those of
`isc`: 0, 2 for bad input, 130 when cancelled.

Limits: in the source tree, the Python that runs this has to have the packages that `isc_core`
needs.
"""

import importlib
import importlib.util
import sys
import traceback
from pathlib import Path
from typing import NoReturn

FAULT = 1  # of this program, not of what it was given


def main(arguments: list[str] | None = None) -> int:
    """Runs the command, with the arguments of the process if None, and returns its exit code."""
    command_line = importlib.import_module(f"{_package()}.headless_command")
    return int(command_line.main(_own_arguments() if arguments is None else arguments))


def _own_arguments() -> list[str]:
    """What Blender leaves to scripts: everything behind `--`.

    Without Blender around it, everything.
    """
    given = sys.argv[1:]
    if "--" in given:
        return given[given.index("--") + 1 :]
    return given if __package__ else []


def _package() -> str:
    """The name of the package that this file is a module of.

    Blender runs the file by itself: then the package may have to be loaded.
    """
    if __package__:
        return __package__
    folder = Path(__file__).resolve().parent
    if (folder / "isc_core").is_dir():
        return _enabled(f"bl_ext.{folder.parent.name}.{folder.name}")
    if importlib.util.find_spec("isc_core") is None:
        _load(folder.parent / "isc_core")
    return _load(folder)


def _enabled(extension: str) -> str:
    """The installed extension, enabled for this run: Blender then knows where its wheels are."""
    if extension not in sys.modules:
        import addon_utils  # type: ignore[import-not-found]

        addon_utils.enable(extension)
    return extension


def _load(folder: Path) -> str:
    """Imports the package in `folder` under the folder's name, wherever it lies: the search path
    stays as it is.
    """
    place = importlib.util.spec_from_file_location(
        folder.name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    if place is None or place.loader is None:
        raise ImportError(f"{folder} is not a package")
    module = importlib.util.module_from_spec(place)
    sys.modules[folder.name] = module
    place.loader.exec_module(module)
    return folder.name


def _run() -> NoReturn:
    """Ends the process with the command's exit code;

    Blender by itself ends with 0 after a script that raised.
    """
    code = FAULT
    try:
        code = main()
    finally:
        if code == FAULT:
            traceback.print_exc()
        sys.exit(code)


if __name__ == "__main__":
    _run()
