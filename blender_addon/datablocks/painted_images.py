"""Images that exist in memory alone, written into the file.

Blender's exporters, and the file of an asset, take an image's packed file. That lacks what has been
painted since the image was packed.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress

import bpy

_STILL = ("FILE", "GENERATED", "TILED")


def pack_images(
    obj: bpy.types.Object, materials: Iterable[bpy.types.Material] = (), *, files: bool = False
) -> None:
    """Pack the images of an object that have been painted on since they were saved.

    Parameters
    ----------
    obj : bpy.types.Object
        The object: its custom properties, and the nodes of its materials.
    materials : iterable of bpy.types.Material, optional
        Materials that it does not use at the moment.
    files : bool, optional
        Whether images that are files beside this .blend file are packed, too.
    """
    for image in _images(obj, materials):
        if image.library is not None or image.source not in _STILL:
            continue
        is_file = image.source != "GENERATED" and image.packed_file is None
        if image.is_dirty or (files and is_file):
            with suppress(RuntimeError):  # its file is gone: nothing to pack
                image.pack()


def _images(obj: bpy.types.Object, materials: Iterable[bpy.types.Material]) -> set[bpy.types.Image]:
    assigned = [slot.material for slot in obj.material_slots if slot.material is not None]
    found = {value for value in obj.values() if isinstance(value, bpy.types.Image)}
    for material in {*assigned, *materials}:
        found.update(_images_of_nodes(material.node_tree, set()))
    return found


def _images_of_nodes(
    tree: bpy.types.NodeTree | None, seen: set[bpy.types.NodeTree]
) -> Iterator[bpy.types.Image]:
    """The images of a tree and of the groups in it."""
    if tree is None or tree in seen:
        return
    seen.add(tree)
    for node in tree.nodes:
        image = getattr(node, "image", None)
        if isinstance(image, bpy.types.Image):
            yield image
        yield from _images_of_nodes(getattr(node, "node_tree", None), seen)
