"""How what ISC made is recognised, and where it comes from: custom properties that are saved and
appended with each datablock.

`isc_key` is the name of the image it was made of (with a number where photos are called alike),
`isc_role` what it is there for ("object", "base_color", "camera", ...). Datablocks are found by
these two, since people rename things and Blender cuts long names.

Limits: a datablock linked from another file belongs to that file: it is never found here, and
cannot be changed.
"""

import json
import math
from collections.abc import Iterable
from typing import Any

import bpy

from isc_core.errors import InputError

from ..files.result_arrays import Result

KEY, ROLE = "isc_key", "isc_role"
PHOTO_HASH, SOURCE_IMAGE, SPECULAR_LEVEL = (
    "isc_photo_sha256",
    "isc_source_image",
    "isc_specular_level",
)
_NAME_BYTES = 63  # of a datablock's name in Blender 4.5; later ones take more


def find(blocks: Iterable[Any], key: str, role: str) -> Any:
    """The local datablock of that key and role, or None."""
    return next(
        (
            block
            for block in blocks
            if block.get(KEY) == key and block.get(ROLE) == role and block.library is None
        ),
        None,
    )


def mark(block: Any, key: str, role: str) -> Any:
    """Makes a datablock one of ISC's; returns it."""
    block[KEY], block[ROLE] = key, role
    return block


def is_isc(block: Any) -> bool:
    """Whether ISC made this datablock."""
    return block is not None and KEY in block


def label(key: str, what: str = "") -> str:
    """A datablock's name: the key and what it is, the key cut so that `what` stays to be read."""
    end = f" {what}" if what else ""
    room = _NAME_BYTES - len(end.encode())
    return key.encode("utf-8", "replace")[:room].decode("utf-8", "ignore") + end


def require_local(key: str) -> None:
    """Raises `InputError` if what ISC made of that name is linked from another file."""
    kinds = (bpy.data.collections, bpy.data.objects, bpy.data.meshes, bpy.data.materials)
    for block in (block for blocks in kinds for block in blocks if block.get(KEY) == key):
        if block.library is not None:
            raise InputError(
                f"{block.name} is linked from {block.library.filepath}, which this file cannot change: make it local "
                "(Object > Relations > Make Local > All) or give another name"
            )


def photo_hash(result: Result) -> str:
    """The SHA-256 of the result's photo, "" where it is not known."""
    return str(result.description.get("input", {}).get("sha256", ""))


def record(block: Any, result: Result, options: str) -> None:
    """Writes what the datablock was made from: photo, settings, versions, status, light, and the
    level of the gloss, 0 where it is not known. `options`: of the build, as JSON.
    """
    described = result.description
    source, settings = described.get("input", {}), described.get("settings", {})
    block["isc_version"] = str(described.get("versions", {}).get("isc", ""))
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
    block["isc_decomposition"] = json.dumps(described, ensure_ascii=False)
