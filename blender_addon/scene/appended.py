"""Objects that are appended from another file, where this file has one of another photo of the same
name: both would have one key, and updating one would change textures, maps and light of the other.
What was appended gets the next free key, as if both had been created in this file.

Limits: an object that is linked and made local later keeps its key.
"""

from collections.abc import Sequence
from typing import Any

import bpy

from ..datablocks.provenance import KEY, ROLE
from .copies import COPY, OBJECT, are_of_one_photo


def separate_appended(blocks: Sequence[Any]) -> None:
    """Give appended datablocks a key of their own where an object of another photo has theirs.

    Parameters
    ----------
    blocks : sequence of bpy.types.ID
        All datablocks that were appended at once; those that are linked stay as they are.
    """
    local = [block for block in blocks if block.library is None and KEY in block]
    objects = {block[KEY]: block for block in local if _is_object(block)}
    for key, obj in objects.items():
        others = [other for other in bpy.data.objects if _is_object(other) and other not in local]
        free = _free_key(obj, others)
        for block in local:
            if free != key and block[KEY] == key:
                block[KEY] = free


def _is_object(block: Any) -> bool:
    return (
        isinstance(block, bpy.types.Object)
        and block.library is None
        and block.get(ROLE) in (OBJECT, COPY)
    )


def _free_key(obj: Any, others: Sequence[Any]) -> str:
    """The key, numbered as for a new object, that no object of another photo has."""
    name, number = str(obj[KEY]), 1
    key = name
    while any(other.get(KEY) == key and not are_of_one_photo(obj, other) for other in others):
        number += 1
        key = f"{name}-{number}"
    return key
