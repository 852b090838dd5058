"""The shape as a modifier: a flat grid that a Displace modifier raises by an image of the heights,
for more or less relief.

The image contains metres toward the viewer, relative to the grid: strength 1 is the recovered
shape. A pixel at a vertex of the height mesh has that vertex's height, so both shapes agree.

Limits: the normals are those of the displaced grid, not the recovered ones.
"""

from dataclasses import replace

import bpy
import numpy as np

from ..files.result_arrays import ResultArrays
from .images import DATA, ensure_image
from .mesh import UV, MeshGeometry, metres_per_pixel
from .provenance import datablock_name, find_tagged, tag

MODIFIER = "ISC Displacement"


def flatten(sheet: MeshGeometry) -> MeshGeometry:
    """Return a mesh without its heights and normals.

    Parameters
    ----------
    sheet : MeshGeometry
        The visible side of the object, in Blender's axes (y away from the viewer).

    Returns
    -------
    MeshGeometry
        The mesh in the plane y = 0.
    """
    return replace(sheet, vertices=sheet.vertices * (1.0, 0.0, 1.0), normals=None)


def displacement_heights(result: ResultArrays, size_metres: float) -> np.ndarray:
    """Return the heights of the displaced grid.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.

    Returns
    -------
    (H, W) ndarray
        Metres toward the viewer, relative to the mesh's origin; 0 outside the mask.
    """
    step = metres_per_pixel(result, size_metres)
    metres = np.where(result.mask, (result.height - result.origin[2]) * step, 0)
    rows, columns = result.vertex_pixel.T
    metres[rows, columns] = result.vertices[:, 2] * (step / result.metres_per_pixel)
    return metres


def add_displacement(
    key: str, obj: bpy.types.Object, result: ResultArrays, size_metres: float
) -> None:
    """Add or update the modifier, its texture and its image; an edited strength is kept.

    Parameters
    ----------
    key : str
        Name of the photo.
    obj : bpy.types.Object
        The object with the flat grid.
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.
    """
    image = ensure_image(key, "displacement", displacement_heights(result, size_metres), DATA)
    texture = find_tagged(bpy.data.textures, key, "displacement")
    texture = texture or tag(
        bpy.data.textures.new(datablock_name(key, "displacement"), "IMAGE"), key, "displacement"
    )
    texture.image, texture.use_interpolation, texture.extension = image, False, "EXTEND"
    modifier = obj.modifiers.get(MODIFIER) or obj.modifiers.new(MODIFIER, "DISPLACE")
    modifier.texture, modifier.texture_coords, modifier.uv_layer = texture, "UV", UV
    modifier.direction, modifier.mid_level = "NORMAL", 0.0


def remove_displacement(key: str, obj: bpy.types.Object) -> None:
    """Remove the modifier, and the texture and image that nothing else uses.

    Parameters
    ----------
    key : str
        Name of the photo.
    obj : bpy.types.Object
        The object.
    """
    modifier = obj.modifiers.get(MODIFIER)
    if modifier is not None:
        obj.modifiers.remove(modifier)
    for blocks in (bpy.data.textures, bpy.data.images):
        block = find_tagged(blocks, key, "displacement")
        if block is not None and block.users == 0:
            blocks.remove(block)
