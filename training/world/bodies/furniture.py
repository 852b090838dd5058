"""Models of furniture and household items, from the catalogues of Sweet Home 3D.

A catalogue is a zip file (`.sh3f`) of OBJ models. Its `PluginFurnitureCatalog.properties` gives the
licence, and for each model its path and author. A model becomes up to six separate items
(`geometry/parts.py`).

Citation: E. Puybaret, Sweet Home 3D, https://www.sweethome3d.com; Debian's package
`sweethome3d-furniture` has five catalogues, under CC0 and CC BY 3.0.

Limits: models above LARGEST bytes are left out unread. Doors and windows are kept as they are.
"""

import re
import zipfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from isc_core.errors import InputError

from .geometry.parts import separate_items
from .geometry.surface import Surface, welded
from .obj_file import read_obj
from .screening import MOST, checked, fault

CATALOGUE = "PluginFurnitureCatalog.properties"
LARGEST = 9_000_000  # bytes of a model's OBJ file
MOST_ITEMS = 6  # of a model
_CROWDED = 4 * MOST  # triangles of a whole model


@dataclass(frozen=True)
class Model:
    """A model of a catalogue.

    Attributes
    ----------
    archive : Path
        The catalogue.
    member : str
        Path of the OBJ file in it.
    name : str
        "BlendSwap-CC-0/vase".
    credit : str
        Author and licence, as the catalogue gives them.
    """

    archive: Path
    member: str
    name: str
    credit: str


def models_in(folder: Path) -> list[Model]:
    """List the models of the catalogues of a folder.

    Parameters
    ----------
    folder : Path
        Contains `.sh3f` files.

    Returns
    -------
    list of Model
        Ordered by name.

    Raises
    ------
    InputError
        If there is no catalogue, or one is not a readable zip file.
    """
    archives = sorted(folder.glob("*.sh3f"))
    if not archives:
        raise InputError(f"{folder} has no .sh3f files: name the folder of the catalogues")
    return sorted(
        (model for archive in archives for model in _models_of(archive)),
        key=lambda model: model.name,
    )


def items_of(archive: Path, member: str, name: str) -> list[Surface]:
    """Read a model and take it apart.

    Parameters
    ----------
    archive : Path
        The catalogue.
    member : str
        Path of the OBJ file in it.
    name : str
        For messages.

    Returns
    -------
    list of Surface
        Separate items that pass the screening, the largest first; empty for a model of too many
        triangles or with vertices that are not finite.

    Raises
    ------
    InputError
        If the model cannot be read or has no surface.
    """
    try:
        with zipfile.ZipFile(archive) as catalogue:
            data = catalogue.read(member)
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{archive} has no readable {member}: download it again") from error
    surface, objects = read_obj(data, name)
    if not np.isfinite(checked(surface, name).vertices).all() or len(surface.faces) > _CROWDED:
        return []
    surface, kept = welded(surface)
    items = separate_items(surface, objects[kept], 2 * MOST_ITEMS)
    return [item for item in items if fault(item) is None][:MOST_ITEMS]


def _models_of(archive: Path) -> list[Model]:
    try:
        with zipfile.ZipFile(archive) as catalogue:
            sizes = {one.filename: one.file_size for one in catalogue.infolist()}
            text = catalogue.read(CATALOGUE).decode("latin-1") if CATALOGUE in sizes else ""
    except (OSError, zipfile.BadZipFile) as error:
        raise InputError(f"{archive} is not a readable zip file: download it again") from error
    properties = dict(re.findall(r"^([\w#]+)=(.*?)\s*$", text, re.MULTILINE))
    licence = properties.get("license", "licence not stated")
    authors = {
        path.lstrip("/"): properties.get(f"creator#{key[6:]}", "author not stated")
        for key, path in properties.items()
        if key.startswith("model#")
    }
    members = [m for m, size in sizes.items() if m.lower().endswith(".obj") and size <= LARGEST]
    return [
        Model(
            archive,
            member,
            f"{archive.stem}/{_short(PurePosixPath(member))}",
            f"{authors.get(member, 'author not stated')}; {licence}",
        )
        for member in members
    ]


def _short(member: PurePosixPath) -> str:
    """Path below the catalogue's top folder without suffix; "vase" for "vase/vase"."""
    parts = member.with_suffix("").parts[1:] or (member.stem,)
    return "/".join(parts[:-1] if parts[-2:-1] == parts[-1:] else parts)
