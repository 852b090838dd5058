"""Invented rigid bodies: a folder of `NUMBER/NUMBER.obj`, such as `pybullet_data/random_urdfs`.

Each is a union of convex pieces, which overlap inside.

Citation: E. Coumans and Y. Bai, PyBullet, https://pybullet.org (zlib licence).

Limits: only the OBJ files are read; of the URDF files' scale and colour nothing is used.
"""

from pathlib import Path

from isc_core.errors import InputError

from .geometry.surface import Surface
from .obj_file import read_obj
from .screening import checked

CREDIT = "Erwin Coumans and others, PyBullet, random_urdfs; zlib licence"


def urdfs_in(folder: Path) -> list[Path]:
    """List the OBJ files of the bodies of a folder.

    Parameters
    ----------
    folder : Path
        Contains one folder a body.

    Returns
    -------
    list of Path
        Ordered by name.

    Raises
    ------
    InputError
        If there is none.
    """
    paths = sorted(path for path in folder.glob("*/*.obj") if path.stem == path.parent.name)
    if not paths:
        raise InputError(f"{folder} has no NUMBER/NUMBER.obj: name the folder random_urdfs")
    return paths


def read_urdf(path: Path) -> Surface:
    """Read a body.

    Parameters
    ----------
    path : Path
        Its OBJ file.

    Returns
    -------
    Surface
        Its triangles.

    Raises
    ------
    InputError
        If the file cannot be read or has no surface.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: check its permissions") from error
    return checked(read_obj(data, str(path))[0], str(path))
