"""The shape as a modifier: a flat grid that a Displace modifier raises by an image of the heights,
for more or less relief.

The image contains metres toward the viewer, relative to the grid: strength 1 is the recovered
shape. A pixel at a vertex of the height mesh has that vertex's height, so both shapes agree.
For a pinhole camera, the displacements are vectors along its rays: seen from there, the object
looks the same at any strength.

Limits: the normals are those of the displaced grid, not the recovered ones.
"""

from dataclasses import replace

import bpy
import numpy as np

from ..datablocks.mesh import UV, MeshGeometry, front_geometry, metres_per_pixel
from ..datablocks.provenance import datablock_name, find_tagged, tag
from ..files.result_arrays import ResultArrays
from .camera import eye_of

MODIFIER = "ISC Displacement"


def flatten(sheet: MeshGeometry, eye: np.ndarray | None = None) -> MeshGeometry:
    """Return a mesh without its heights and normals.

    Parameters
    ----------
    sheet : MeshGeometry
        The visible side of the object, in Blender's axes (y away from the viewer).
    eye : (3,) ndarray, optional
        Position of a pinhole camera, along whose rays the vertices are moved.

    Returns
    -------
    MeshGeometry
        The mesh in the plane y = 0.
    """
    return replace(sheet, vertices=_on_plane(sheet.vertices, eye), normals=None)


def _on_plane(vertices: np.ndarray, eye: np.ndarray | None) -> np.ndarray:
    if eye is None:
        return np.asarray(vertices * (1.0, 0.0, 1.0))
    ray = vertices - eye
    return np.asarray(eye - ray * (eye[1] / ray[:, 1:2]))


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


def displacement_vectors(result: ResultArrays, size_metres: float, eye: np.ndarray) -> np.ndarray:
    """Return the displacements of the grid for a pinhole camera.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.
    eye : (3,) ndarray
        Position of the camera, see `eye_of`.

    Returns
    -------
    (H, W, 3) ndarray
        Metres in Blender's axes at the pixels of vertices; 0 elsewhere.
    """
    vertices = front_geometry(result, size_metres).vertices
    vectors = np.zeros((*result.mask.shape, 3))
    rows, columns = result.vertex_pixel.T
    vectors[rows, columns] = vertices - _on_plane(vertices, eye)
    return vectors


def displacement_map(result: ResultArrays, size_metres: float) -> np.ndarray:
    """Return the displacements of the grid; may run in another thread.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.

    Returns
    -------
    (H, W) or (H, W, 3) ndarray
        Heights; vectors for a pinhole camera.
    """
    eye = eye_of(result, size_metres)
    if eye is None:
        return displacement_heights(result, size_metres)
    return displacement_vectors(result, size_metres, eye)


def add_displacement(
    key: str, obj: bpy.types.Object, image: bpy.types.Image, along_rays: bool
) -> None:
    """Add or update the modifier and its texture, without changing the strength of an existing one.

    Linked copies (Alt D) have the same mesh and get the modifier, too.

    Parameters
    ----------
    key : str
        Name of the photo.
    obj : bpy.types.Object
        The object with the flat grid.
    image : bpy.types.Image
        The displacements.
    along_rays : bool
        Whether they are vectors.
    """
    texture = find_tagged(bpy.data.textures, key, "displacement")
    texture = texture or tag(
        bpy.data.textures.new(datablock_name(key, "displacement"), "IMAGE"), key, "displacement"
    )
    texture.image, texture.use_interpolation, texture.extension = image, False, "EXTEND"
    texture.use_clamp = False  # heights and vectors have negative parts
    for one in _with_its_mesh(obj):
        modifier = one.modifiers.get(MODIFIER) or one.modifiers.new(MODIFIER, "DISPLACE")
        modifier.texture, modifier.texture_coords, modifier.uv_layer = texture, "UV", UV
        modifier.direction, modifier.mid_level = "RGB_TO_XYZ" if along_rays else "NORMAL", 0.0


def remove_displacement(key: str, obj: bpy.types.Object) -> None:
    """Remove the modifier, also of linked copies, and the texture and image that nothing else uses.

    Parameters
    ----------
    key : str
        Name of the photo.
    obj : bpy.types.Object
        The object.
    """
    for one in _with_its_mesh(obj):
        modifier = one.modifiers.get(MODIFIER)
        if modifier is not None:
            one.modifiers.remove(modifier)
    for blocks in (bpy.data.textures, bpy.data.images):
        block = find_tagged(blocks, key, "displacement")
        if block is not None and block.users == 0:
            blocks.remove(block)


def _with_its_mesh(obj: bpy.types.Object) -> list[bpy.types.Object]:
    """The local objects with the mesh of an object."""
    return [one for one in bpy.data.objects if one.data == obj.data and one.library is None]
