"""The shape as a modifier: a flat grid that a Displace modifier lifts by an image of the heights,
for more or less relief.

The image holds metres toward the viewer, counted from the grid: strength 1 is the recovered shape.
Its pixels under a vertex of the height mesh have that vertex' height, so that both stand alike.

Limits: the normals are those of the displaced grid, not the recovered ones.
"""

from dataclasses import replace

import bpy
import numpy as np

from ..files.result_arrays import Result
from .images import DATA, ensure_image
from .mesh import UV, Geometry, metres_per_pixel
from .provenance import find, label, mark

MODIFIER = "ISC Displacement"


def flattened(sheet: Geometry) -> Geometry:
    """The sheet without its heights and normals."""
    return replace(sheet, vertices=sheet.vertices * (1.0, 0.0, 1.0), normals=None)


def heights(result: Result, size_metres: float) -> np.ndarray:
    """(H, W): metres toward the viewer, counted from the mesh's origin; 0 outside the mask."""
    step = metres_per_pixel(result, size_metres)
    metres = np.where(result.mask, (result.height - result.origin[2]) * step, 0)
    rows, columns = result.vertex_pixel.T
    metres[rows, columns] = result.vertices[:, 2] * (step / result.metres_per_pixel)
    return metres


def displace(key: str, thing: bpy.types.Object, result: Result, size_metres: float) -> None:
    """Puts the modifier on the object, with its texture and image; the strength that people set
    stays.
    """
    image = ensure_image(key, "displacement", heights(result, size_metres), DATA)
    texture = find(bpy.data.textures, key, "displacement")
    texture = texture or mark(
        bpy.data.textures.new(label(key, "displacement"), "IMAGE"), key, "displacement"
    )
    texture.image, texture.use_interpolation, texture.extension = image, False, "EXTEND"
    modifier = thing.modifiers.get(MODIFIER) or thing.modifiers.new(MODIFIER, "DISPLACE")
    modifier.texture, modifier.texture_coords, modifier.uv_layer = texture, "UV", UV
    modifier.direction, modifier.mid_level = "NORMAL", 0.0


def undo_displacement(key: str, thing: bpy.types.Object) -> None:
    """Takes the modifier away, and what only it used."""
    modifier = thing.modifiers.get(MODIFIER)
    if modifier is not None:
        thing.modifiers.remove(modifier)
    for blocks in (bpy.data.textures, bpy.data.images):
        block = find(blocks, key, "displacement")
        if block is not None and block.users == 0:
            blocks.remove(block)
