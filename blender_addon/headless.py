"""Photos to .blend files and renders without a window.

    blender -b -P blender_addon/headless.py -- photo.png --mask mask.png -o out.blend
    python -m blender_addon.headless photo.png --mask mask.png -o out.blend --render out.png

The first form works with this file in the source tree and in an installed extension. The second
requires the `bpy` module. Everything after `--` is parsed by `headless_command`. Exit codes are
those of `isc`: 0, 2 for invalid input, 130 when cancelled.

Limits: in the source tree, the Python that runs this must have the packages that `isc_core` needs.
"""

import importlib
import importlib.util
import sys
import traceback
from pathlib import Path
from typing import NoReturn

INTERNAL_ERROR = 1


def main(arguments: list[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : list of str, optional
        Arguments; those of the process if None.

    Returns
    -------
    int
        Exit code.
    """
    command = importlib.import_module(f"{_package()}.headless_command")
    return int(command.main(_own_arguments() if arguments is None else arguments))


def _own_arguments() -> list[str]:
    """The arguments that Blender leaves to scripts, after `--`; without Blender, all of them."""
    given = sys.argv[1:]
    if "--" in given:
        return given[given.index("--") + 1 :]
    return given if __package__ else []


def _package() -> str:
    """The name of this file's package; loaded first where Blender runs the file as a script."""
    if __package__:
        return __package__
    folder = Path(__file__).resolve().parent
    if (folder / "isc_core").is_dir():
        return _enable(f"bl_ext.{folder.parent.name}.{folder.name}")
    if importlib.util.find_spec("isc_core") is None:
        _load(folder.parent / "isc_core")
    return _load(folder)


def _enable(extension: str) -> str:
    """Enable the installed extension for this process, which makes its wheels importable."""
    if extension not in sys.modules:
        import addon_utils  # type: ignore[import-not-found]

        addon_utils.enable(extension)
    return extension


def _load(folder: Path) -> str:
    """Import the package in `folder` under the folder's name, without changing the search path."""
    spec = importlib.util.spec_from_file_location(
        folder.name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"{folder} is not a package")
    module = importlib.util.module_from_spec(spec)
    sys.modules[folder.name] = module
    spec.loader.exec_module(module)
    return folder.name


def _run_and_exit() -> NoReturn:
    """Exit with the command's code; Blender itself exits with 0 after a script that raised."""
    code = INTERNAL_ERROR
    try:
        code = main()
    finally:
        if code == INTERNAL_ERROR:
            traceback.print_exc()
        sys.exit(code)


if __name__ == "__main__":
    _run_and_exit()
