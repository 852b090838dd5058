"""Scanned and modelled bodies from PLY files.

Equation: one body a file. Its credit is the last column of the row `| NAME.ply | ... |` of a table
in README.md in the files' folder or the one above.

Limits: a file's own normals and colours are ignored.
"""

import re
import struct
from pathlib import Path

import numpy as np

from isc_core.errors import InputError

from .geometry.surface import Surface
from .screening import checked


def scans_in(folder: Path) -> list[tuple[Path, str]]:
    """List the scans of a folder.

    Parameters
    ----------
    folder : Path
        Contains `.ply` files.

    Returns
    -------
    list of (Path, str)
        Each file and its credit, ordered by name.

    Raises
    ------
    InputError
        If there is no PLY file.
    """
    paths = sorted(folder.glob("*.ply"))
    if not paths:
        raise InputError(f"{folder} has no .ply files: name the folder of the scans")
    tables = [place / "README.md" for place in (folder, folder.resolve().parent)]
    text = "\n".join(one.read_text(encoding="utf-8") for one in tables if one.is_file())
    credits = dict(re.findall(r"^\| *([\w.-]+\.ply) *\|.*\| *([^|]*?) *\| *$", text, re.MULTILINE))
    return [(path, credits.get(path.name, "licence not stated")) for path in paths]


def read_scan(path: Path) -> Surface:
    """Read the triangles of a PLY file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Surface
        Its triangles.

    Raises
    ------
    InputError
        If the file cannot be read or has no surface.
    """
    import trimesh

    try:
        loaded = trimesh.load(path, file_type="ply", process=False, force="mesh")
    except (OSError, ValueError, LookupError, TypeError, AttributeError, struct.error) as error:
        raise InputError(f"{path} is not a readable PLY file: export the mesh again") from error
    faces = np.asarray(getattr(loaded, "faces", np.empty((0, 3))), int).reshape(-1, 3)
    vertices = np.asarray(getattr(loaded, "vertices", np.empty((0, 3))), float).reshape(-1, 3)
    return checked(Surface(vertices, faces), str(path))
