"""A result folder as a .blend file, without a window: `python -m blender_addon.headless RESULT --blend OUT.blend [--render OUT.png]`."""

import argparse
import sys
from pathlib import Path

from isc_core.errors import InputError

from .result import read_placement


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns 0, or 2 after one line about what was wrong."""
    parser = argparse.ArgumentParser(prog="python -m blender_addon.headless", description="Build a Blender scene of a result.")
    parser.add_argument("result", type=Path, help="folder that isc decompose wrote")
    parser.add_argument("--blend", type=Path, required=True, help="the .blend file to write")
    parser.add_argument("--render", type=Path, help="a PNG file to render to, with Cycles")
    parser.add_argument("--samples", type=int, default=32, help="rays per pixel (default: %(default)s)")
    parser.add_argument("--gloss", action="store_true", help="keep the material's gloss even where it was not fitted")
    options = parser.parse_args(arguments)
    try:
        run(options.result, options.blend, options.render, options.samples, options.gloss)
    except InputError as error:
        print(f"blender: {error}", file=sys.stderr)
        return 2
    return 0


def run(result: Path, blend: Path, render: Path | None = None, samples: int = 32, gloss: bool = False) -> None:
    """Builds the scene of a result folder, saves it as `blend`, and renders it to `render`.

    Raises `InputError` without the bpy module, for a folder that is no result, or where a file cannot be written.
    """
    if samples < 1:
        raise InputError("--samples must be 1 or more")
    placement = read_placement(result)
    try:
        import bpy
    except ImportError as error:
        raise InputError(f"this needs Blender's Python module ({error}): install it with `pip install 'isc3d[blender]'`") from error
    from .scene import build

    scene = build(placement, samples, gloss)
    try:
        blend.parent.mkdir(parents=True, exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(blend.resolve()), check_existing=False)
        if render is not None:
            render.parent.mkdir(parents=True, exist_ok=True)
            scene.render.filepath = str(render.resolve())
            bpy.ops.render.render(write_still=True)
    except (OSError, RuntimeError) as error:
        raise InputError(f"cannot write the scene: {str(error).strip().splitlines()[-1]}") from error


if __name__ == "__main__":
    sys.exit(main())
