"""Copies of an object (Shift D, Alt D): an edit changes the active object and no other.

A copy has the key, the role and at first the material of its original. The first object of a key is
the original, which is updated when its photo is decomposed again; the others are copies. Once a
copy has its own material, both have the role "copy", so that they are not mistaken for the
original.
World, sun and camera belong to the original and its copies alike.

Limits: while they share everything, the order of their names decides which one is the original.
"""

import bpy

from ..datablocks.provenance import (
    KEY,
    PHOTO_HASH,
    ROLE,
    SOURCE_IMAGE,
    all_tagged,
    find_tagged,
    tag,
)

OBJECT, MATERIAL, COPY = "object", "material", "copy"
# Of an object: its material, so that the file keeps it where another one is assigned.
_OWN_MATERIAL = "isc_material"


def find_original(obj: bpy.types.Object) -> bpy.types.Object | None:
    """Find the object that ISC built from the same photo.

    Parameters
    ----------
    obj : bpy.types.Object
        An object of ISC; may be the original itself.

    Returns
    -------
    bpy.types.Object or None
        None if the original was deleted.
    """
    originals = all_tagged(bpy.data.objects, obj[KEY], OBJECT)
    return next((other for other in originals if are_of_one_photo(obj, other)), None)


def are_of_one_photo(obj: bpy.types.Object, other: bpy.types.Object) -> bool:
    """Return whether two objects of one key were built from the same photo.

    Parameters
    ----------
    obj, other : bpy.types.Object
        Objects of ISC.

    Returns
    -------
    bool
        By their images in this file, as the photo may have been edited; otherwise by the hashes. An
        unknown photo is the same.
    """
    images = obj.get(SOURCE_IMAGE), other.get(SOURCE_IMAGE)
    if None not in images:
        return bool(images[0] == images[1])
    hashes = obj.get(PHOTO_HASH, ""), other.get(PHOTO_HASH, "")
    return "" in hashes or hashes[0] == hashes[1]


def is_copy(obj: bpy.types.Object) -> bool:
    """Return whether an object is a copy of one that ISC built.

    Parameters
    ----------
    obj : bpy.types.Object
        Any object.

    Returns
    -------
    bool
        False for the original and for objects that ISC did not build.
    """
    return obj.get(ROLE) in (OBJECT, COPY) and find_original(obj) != obj


def find_material(obj: bpy.types.Object) -> bpy.types.Material | None:
    """Find the material of ISC that belongs to an object.

    Parameters
    ----------
    obj : bpy.types.Object
        An object of ISC.

    Returns
    -------
    bpy.types.Material or None
        The assigned one; for an original that has none or the user's, the material that was built
        for it.
    """
    assigned = (slot.material for slot in obj.material_slots)
    found = next(
        (
            material
            for material in assigned
            if material is not None and material.get(KEY) == obj[KEY]
        ),
        None,
    )
    if found is not None or is_copy(obj):
        return found
    return obj.get(_OWN_MATERIAL) or find_tagged(bpy.data.materials, obj[KEY], MATERIAL)


def keep_material(obj: bpy.types.Object, material: bpy.types.Material) -> None:
    """Store the material of an object in it: it stays in the file while another one is assigned.

    Parameters
    ----------
    obj : bpy.types.Object
        An object of ISC.
    material : bpy.types.Material
        The material that was built for it.
    """
    obj[_OWN_MATERIAL] = material


def has_other_material(obj: bpy.types.Object, material: bpy.types.Material) -> bool:
    """Return whether an object has materials, but not a certain one.

    Parameters
    ----------
    obj : bpy.types.Object
        The object.
    material : bpy.types.Material
        The material.

    Returns
    -------
    bool
        False for an object without materials.
    """
    assigned = {slot.material for slot in obj.material_slots} - {None}
    return bool(assigned) and material not in assigned


def copies_of(obj: bpy.types.Object, key: str) -> list[bpy.types.Object]:
    """Find the copies of an object.

    Parameters
    ----------
    obj : bpy.types.Object
        The original.
    key : str
        Name of the photo.

    Returns
    -------
    list of bpy.types.Object
        Local objects.
    """
    return [
        other
        for other in bpy.data.objects
        if other != obj
        and other.get(KEY) == key
        and other.get(ROLE) in (OBJECT, COPY)
        and other.library is None
        and are_of_one_photo(obj, other)
    ]


def materials_of_copies(obj: bpy.types.Object, key: str) -> list[bpy.types.Material]:
    """Find the materials of ISC that copies of an object have of their own.

    Parameters
    ----------
    obj : bpy.types.Object
        The original.
    key : str
        Name of the photo.

    Returns
    -------
    list of bpy.types.Material
        Without that of the original.
    """
    own = find_material(obj)
    found = {
        slot.material: None
        for other in copies_of(obj, key)
        for slot in other.material_slots
        if slot.material not in (None, own) and slot.material.get(KEY) == key
    }
    return [material for material in found if material.library is None]


def objects_sharing_material(
    obj: bpy.types.Object, material: bpy.types.Material
) -> list[bpy.types.Object]:
    """Find other objects of the same photo that use a material.

    Parameters
    ----------
    obj : bpy.types.Object
        An object of ISC.
    material : bpy.types.Material
        Its material.

    Returns
    -------
    list of bpy.types.Object
        Objects that change with the material.
    """
    family = (
        other
        for other in bpy.data.objects
        if other != obj and other.get(KEY) == obj[KEY] and other.library is None
    )
    return [
        other for other in family if any(slot.material == material for slot in other.material_slots)
    ]


def make_material_single_user(
    obj: bpy.types.Object, material: bpy.types.Material
) -> bpy.types.Material:
    """Give an object a material that no other object of the same photo uses.

    The original keeps the first material; copies get their own.

    Parameters
    ----------
    obj : bpy.types.Object
        An object of ISC.
    material : bpy.types.Material
        Its material.

    Returns
    -------
    bpy.types.Material
        The object's material.
    """
    others = objects_sharing_material(obj, material)
    if is_copy(obj):
        tag(obj, obj[KEY], COPY)
        return _copy_material(obj, material) if others else tag(material, obj[KEY], COPY)
    for other in others:
        _copy_material(tag(other, obj[KEY], COPY), material)
    return material


def _copy_material(obj: bpy.types.Object, material: bpy.types.Material) -> bpy.types.Material:
    """Copy the material for an object; on a shared mesh its slot becomes the object's own."""
    own = tag(material.copy(), obj[KEY], COPY)
    for slot in obj.material_slots:
        if slot.material == material:
            if obj.data.users > 1:
                slot.link = "OBJECT"
            slot.material = own
    return own
