"""Copies that people make of an object (Shift D, Alt D): what is edited is the object that is
active, and no other.

A copy has the key, the role and at first the material of what it was copied from. The first object
of a key is the original, which is updated when its photo is decomposed again; the others are
copies. Once a copy has a material of its own, both have the role "copy", so that they are never
taken for the original. World, sun and camera belong to the original and its copies alike.

Limits: while they share everything, which of them is the original is told by the order of their
names.
"""

import bpy

from .provenance import KEY, ROLE, find, mark

OBJECT, MATERIAL, COPY = "object", "material", "copy"


def original_of(thing: bpy.types.Object) -> bpy.types.Object | None:
    """The object that ISC made of the same photo, which may be `thing` itself;

    None where it was deleted.
    """
    return find(bpy.data.objects, thing[KEY], OBJECT)


def is_copy(thing: bpy.types.Object) -> bool:
    """Whether an object was copied from the one that ISC made."""
    return thing.get(ROLE) in (OBJECT, COPY) and original_of(thing) != thing


def material_of(thing: bpy.types.Object) -> bpy.types.Material | None:
    """The material of ISC that an object wears; for an original that wears none the one that was
    made for it.
    """
    worn = (slot.material for slot in thing.material_slots)
    found = next(
        (material for material in worn if material is not None and material.get(KEY) == thing[KEY]),
        None,
    )
    return (
        found
        if found is not None or is_copy(thing)
        else find(bpy.data.materials, thing[KEY], MATERIAL)
    )


def sharers(thing: bpy.types.Object, material: bpy.types.Material) -> list[bpy.types.Object]:
    """Other objects of the same photo that wear the material of `thing`: what is changed on it
    shows on them, too.
    """
    family = (
        other
        for other in bpy.data.objects
        if other != thing and other.get(KEY) == thing[KEY] and other.library is None
    )
    return [
        other for other in family if any(slot.material == material for slot in other.material_slots)
    ]


def own_material(thing: bpy.types.Object, material: bpy.types.Material) -> bpy.types.Material:
    """A material that no other object of the same photo wears: the copies are given their own, the
    original keeps the first one.
    """
    others = sharers(thing, material)
    if is_copy(thing):
        mark(thing, thing[KEY], COPY)
        return _given_own(thing, material) if others else mark(material, thing[KEY], COPY)
    for other in others:
        _given_own(mark(other, thing[KEY], COPY), material)
    return material


def _given_own(thing: bpy.types.Object, material: bpy.types.Material) -> bpy.types.Material:
    """Copies the material for the object.

    On a mesh that is shared, its slot becomes the object's own.
    """
    own = mark(material.copy(), thing[KEY], COPY)
    for slot in thing.material_slots:
        if slot.material == material:
            if thing.data.users > 1:
                slot.link = "OBJECT"
            slot.material = own
    return own
