"""How ISC's datablocks are identified, and what they were made from: custom properties that are
saved and appended with each datablock.

`isc_key` is the name of the photo (numbered where photos share a name), `isc_role` the datablock's
purpose ("object", "base_color", "camera", ...). Datablocks are identified by these two, since users
rename them and Blender shortens long names.

Limits: a datablock linked from another file belongs to that file: it is never found here and cannot
be changed.
"""

import json
import math
from collections.abc import Iterable, Iterator
from typing import Any

import bpy

from isc_core.errors import InputError

from ..files.result_arrays import ResultArrays

KEY, ROLE = "isc_key", "isc_role"
PHOTO_HASH, SOURCE_IMAGE, SPECULAR_LEVEL = (
    "isc_photo_sha256",
    "isc_source_image",
    "isc_specular_level",
)
# Of a mask that ISC found: its photo. Earlier versions wrote the mask's name, "PHOTO mask".
MASK_OF = "isc_mask_of"
# Roles that earlier versions wrote.
_FORMER_ROLES = {"environment_map": "sky"}
_NAME_BYTES = 63  # limit of a datablock's name in Blender 4.5; later versions allow more


def find_tagged(blocks: Iterable[Any], key: str, role: str) -> Any:
    """Find the local datablock of a key and a role.

    Parameters
    ----------
    blocks : iterable of bpy.types.ID
        For example `bpy.data.objects`.
    key : str
        Name of the photo.
    role : str
        Purpose of the datablock.

    Returns
    -------
    bpy.types.ID or None
        The datablock.
    """
    return next(all_tagged(blocks, key, role), None)


def all_tagged(blocks: Iterable[Any], key: str, role: str) -> Iterator[Any]:
    """Find all local datablocks of a key and a role.

    Parameters
    ----------
    blocks, key, role
        As of `find_tagged`.

    Yields
    ------
    bpy.types.ID
    """
    roles = (role, _FORMER_ROLES.get(role, role))
    for block in blocks:
        if block.get(KEY) == key and block.get(ROLE) in roles and block.library is None:
            yield block


def tag(block: Any, key: str, role: str) -> Any:
    """Mark a datablock as one of ISC's.

    Parameters
    ----------
    block : bpy.types.ID
        The datablock.
    key : str
        Name of the photo.
    role : str
        Purpose of the datablock.

    Returns
    -------
    bpy.types.ID
        The same datablock.
    """
    block[KEY], block[ROLE] = key, role
    return block


def is_isc_datablock(block: Any) -> bool:
    """Return whether ISC made a datablock.

    Parameters
    ----------
    block : bpy.types.ID or None
        The datablock.

    Returns
    -------
    bool
        False for None.
    """
    return block is not None and KEY in block


def datablock_name(key: str, suffix: str = "", before: str = " ") -> str:
    """Return the key and a suffix; a long key is shortened so that the suffix remains.

    Parameters
    ----------
    key : str
        Name of the photo.
    suffix : str, optional
        What follows the key; "" for the key alone.
    before : str, optional
        What stands between them.

    Returns
    -------
    str
        Name of at most 63 bytes in UTF-8.
    """
    end = f"{before}{suffix}" if suffix else ""
    room = _NAME_BYTES - len(end.encode())
    return key.encode("utf-8", "replace")[:room].decode("utf-8", "ignore") + end


def require_local(key: str) -> None:
    """Check that no datablock of a key is linked from another file.

    Parameters
    ----------
    key : str
        Name of the photo.

    Raises
    ------
    InputError
        If one is.
    """
    kinds = (bpy.data.collections, bpy.data.objects, bpy.data.meshes, bpy.data.materials)
    for block in (block for blocks in kinds for block in blocks if block.get(KEY) == key):
        if block.library is not None:
            raise InputError(
                f"{block.name} is linked from {block.library.filepath} and cannot be changed: "
                "make it local (Object > Relations > Make Local > All) or choose another name"
            )


def photo_hash(result: ResultArrays) -> str:
    """Return the SHA-256 of the result's photo.

    Parameters
    ----------
    result : ResultArrays
        The result.

    Returns
    -------
    str
        Hexadecimal digits; "" if unknown.
    """
    return str(result.description.get("input", {}).get("sha256", ""))


def write_provenance(block: Any, result: ResultArrays, options: str) -> None:
    """Store what a datablock was made from: photo, settings, versions, status and light.

    Parameters
    ----------
    block : bpy.types.ID
        The datablock.
    result : ResultArrays
        The result; an unknown specular level is stored as 0.
    options : str
        Build options as JSON.
    """
    description = result.description
    source, settings = description.get("input", {}), description.get("settings", {})
    block["isc_version"] = str(description.get("versions", {}).get("isc", ""))
    block["isc_photo"] = str(source.get("name", ""))
    block[PHOTO_HASH] = photo_hash(result)
    block["isc_model"] = str(settings.get("model", ""))
    block["isc_separator"] = str(settings.get("separator", ""))
    block["isc_folder"] = str(result.folder)
    for name in ("sun_direction", "sun_strength", "sun_ambient"):
        block[f"isc_{name}"] = [float(part) for part in getattr(result, name)]
    block["isc_sun_explained"], block["isc_sun_cone"] = result.sun_explained, result.sun_cone
    block[SPECULAR_LEVEL] = result.specular_level if math.isfinite(result.specular_level) else 0.0
    block["isc_options"] = options
    block["isc_decomposition"] = json.dumps(description, ensure_ascii=False)
