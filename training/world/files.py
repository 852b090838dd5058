"""The folder of a world: one archive of views for each reference of the list of objects.

    DIR/world.json            format, seed, number of views of a body
    DIR/views/NUMBER.npz      the views of one reference, `View` by `View`; or why it has none
    DIR/patterns.npz          the patterns that bodies are painted with
    DIR/CREDITS.txt           authors and licences of all bodies with views

Splits: all views of a reference lie in one split. `UNSEEN_SOURCE` has sources that are not used for
training, `UNSEEN_BODY` one in eight references of the others, chosen by a hash of the name. Where
choices and reports need different bodies, `half_of` divides the held-out ones by another hash.

Limits: views of another format are refused, not converted.
"""

import json
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.lib.npyio import NpzFile

from isc_core.errors import InputError
from isc_core.io.atomic import new_file

from ..archives import open_archive
from .patterns import Atlas
from .views import DIRECTIONS, SIDE, View

FORMAT = 3  # 2: flat faces beside bevels had the normals of cushions
SETTINGS, VIEWS, CREDITS = "world.json", "views", "CREDITS.txt"
PATTERNS, PATTERN_COUNT = "patterns.npz", 1500
HELD_OUT_OF = 8
HELD_OUT_SOURCES = ("scan/", "furniture/Reallusion", "furniture/KatorLegaz")
_PARTS = ("mask", "normal", "depth", "thickness", "visible", "directions", "up")


class Split(StrEnum):
    """What a view may be used for."""

    TRAIN = "train"
    UNSEEN_BODY = "body"
    UNSEEN_SOURCE = "source"


@dataclass(frozen=True)
class WorldSettings:
    """What a world's folder was made with.

    Attributes
    ----------
    seed : int
    views : int
        Of each body.
    built, families : int
        Bodies in the list that are built, and of synth's families.
    """

    seed: int
    views: int
    built: int
    families: int

    def as_json(self) -> dict[str, int]:
        """Return the settings with the format, as `world.json` holds them."""
        return {"format": FORMAT, **self.__dict__}


def split_of(name: str) -> Split:
    """Return the set of a reference.

    Parameters
    ----------
    name : str
        Of the reference, such as "scan/cat".

    Returns
    -------
    Split
    """
    if name.startswith(HELD_OUT_SOURCES):
        return Split.UNSEEN_SOURCE
    return Split.UNSEEN_BODY if crc32(name.encode()) % HELD_OUT_OF == 0 else Split.TRAIN


def half_of(name: str) -> int:
    """Return the half of the held-out bodies that a body belongs to.

    Parameters
    ----------
    name : str
        Of the body. What precedes its last "-" is common to the parts of one piece of furniture.

    Returns
    -------
    int
        0 or 1.
    """
    whole = name.rpartition("-")[0] or name
    return crc32(whole.encode()) // HELD_OUT_OF % 2


def claim_folder(folder: Path, settings: WorldSettings) -> None:
    """Prepare a folder for a world, or continue one.

    Parameters
    ----------
    folder : Path
    settings : WorldSettings

    Raises
    ------
    InputError
        If the folder holds another world, or something else.
    """
    path = folder / SETTINGS
    if not path.exists():
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder} is not empty and no world: choose another folder")
        (folder / VIEWS).mkdir(parents=True, exist_ok=True)
        with new_file(path) as temporary:
            temporary.write_text(json.dumps(settings.as_json(), indent=1), encoding="utf-8")
        return
    found = _read_settings(path)
    if found != settings.as_json():
        raise InputError(
            f"{folder} holds a world of other settings ({found}, not {settings.as_json()}): "
            "choose another folder or the same settings"
        )


def _read_settings(path: Path) -> dict[str, int]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise InputError(f"{path} cannot be read: {error}") from error
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise InputError(
            f"{path.parent} is a world of another version: build a new one with isc world build"
        )
    return found


def write_patterns(folder: Path, atlas: Atlas) -> None:
    """Write the patterns of a world.

    Parameters
    ----------
    folder : Path
    atlas : Atlas
    """
    with new_file(folder / PATTERNS) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, maps=atlas.maps, kinds=atlas.kinds, tileable=atlas.tileable)


def read_patterns(folder: Path) -> Atlas:
    """Read the patterns of a world.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    Atlas

    Raises
    ------
    InputError
        If there are none, or the file is damaged.
    """
    path = folder / PATTERNS
    with open_archive(path, "an archive of patterns", "delete it and build again") as data:
        atlas = Atlas(data["maps"], data["kinds"], data["tileable"])
    if atlas.maps.ndim != 3 or len(atlas.kinds) != len(atlas.maps) or not len(atlas.maps):
        raise InputError(f"{path} holds no patterns: delete it and build again")
    return atlas


def write_views(path: Path, reference: str, views: list[View], reason: str) -> None:
    """Write the views of one reference.

    Parameters
    ----------
    path : Path
        Of the archive.
    reference : str
        Its name.
    views : list of View
        May be empty.
    reason : str
        Why it has none; empty otherwise.
    """
    arrays = {"reference": np.array(reference), "reason": np.array(reason)}
    arrays["names"] = np.array([view.name for view in views], dtype=np.str_)
    for k, view in enumerate(views):
        for part in _PARTS:
            arrays[f"{part}{k}"] = getattr(view, part)
        arrays[f"distance{k}"] = np.array(view.distance)
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def read_views(path: Path) -> tuple[str, list[View]]:
    """Read the views of one reference.

    Parameters
    ----------
    path : Path

    Returns
    -------
    reference : str
    views : list of View

    Raises
    ------
    InputError
        If the file is no such archive.
    """
    with _open_views(path) as data:
        reference = str(data["reference"])
        source = reference.partition("/")[0]
        views = [
            View(
                name=str(name),
                source=source,
                distance=float(data[f"distance{k}"]),
                **{part: data[f"{part}{k}"] for part in _PARTS},
            )
            for k, name in enumerate(data["names"])
        ]
    for view in views:
        count = int(view.mask.sum())
        wanted = ((SIDE, SIDE), (count, 3), (count,), (count,), (count, DIRECTIONS // 8))
        if tuple(getattr(view, part).shape for part in _PARTS) != (*wanted, (DIRECTIONS, 3), (3,)):
            raise InputError(f"{path} holds views of another shape: delete it and build it again")
    return reference, views


def views_in(folder: Path, split: Split) -> Iterator[View]:
    """Read the views of a world that belong to one set.

    Parameters
    ----------
    folder : Path
    split : Split

    Yields
    ------
    View
        In the order of the list of objects.

    Raises
    ------
    InputError
        If the folder is no world, or one of another version.
    """
    if not (folder / SETTINGS).is_file():
        raise InputError(f"{folder} is no world: make one with isc world build")
    _read_settings(folder / SETTINGS)
    for path in sorted((folder / VIEWS).glob("*.npz")):
        if split_of(_reference_of(path)) == split:
            yield from read_views(path)[1]


def _reference_of(path: Path) -> str:
    """The reference of an archive, without unpacking its views."""
    with _open_views(path) as data:
        return str(data["reference"])


def _open_views(path: Path) -> AbstractContextManager[NpzFile]:
    return open_archive(path, "an archive of views", "delete it and build again")
