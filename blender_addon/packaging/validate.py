"""Blender's own strict validation of a zip, as `blender --command extension validate` runs it, in a
separate process with the bpy module.
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
    """Validate a zip.

    Parameters
    ----------
    archive : Path
        The zip.

    Returns
    -------
    bool
        False if the bpy module is not installed, so that nothing was checked.

    Raises
    ------
    InputError
        If the zip is invalid, with Blender's message.
    """
    if importlib.util.find_spec("bpy") is None:
        return False
    command = [sys.executable, "-c", _CODE, str(archive.resolve())]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    if done.returncode:
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        raise InputError(f"Blender rejects {archive.name}: {' '.join(lines[-6:])}")
    return True
