"""Blender's own strict check of a zip, as its `blender --command extension validate` does it; run
in the bpy module, in a process apart.
"""

import importlib.util
import subprocess
import sys
from pathlib import Path

from isc_core.errors import InputError

_CODE = """
import sys
import bpy
from bl_pkg.bl_extension_cli import cli_extension_handler
sys.exit(cli_extension_handler(["validate", sys.argv[1]]))
"""


def validate(archive: Path) -> bool:
    """Whether the check was made: it needs the bpy module.

    Raises `InputError` with Blender's words if the zip does not pass.
    """
    if importlib.util.find_spec("bpy") is None:
        return False
    command = [sys.executable, "-c", _CODE, str(archive.resolve())]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    if done.returncode:
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        raise InputError(f"Blender refuses {archive.name}: {' '.join(lines[-6:])}")
    return True
