"""How the user has shaded a mesh: what *Update Object* repeats on the new mesh.

A mesh with the recovered normals looks alike after *Shade Smooth*, *Shade Flat* and *Shade Smooth
by Angle*; it differs once its custom normals have been cleared.

Limits: faces and edges that were made flat or sharp one by one belong to the mesh and cannot be
repeated on another one.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from ..datablocks.mesh import NORMAL

SHARP_FACE, SHARP_EDGE = "sharp_face", "sharp_edge"
_HALVINGS = 24  # of the interval of angles, half a circle
_BUILT_NORMALS = "isc_built_normals"  # of a mesh: whether it had the recovered normals


@dataclass(frozen=True)
class ShadingChoice:
    """The shading of a whole mesh.

    Attributes
    ----------
    flat : bool
        Shade Flat.
    sharp_angle : float or None
        Of Shade Smooth by Angle, in radians.
    cleared : bool
        Whether the recovered normals were cleared.
    """

    flat: bool = False
    sharp_angle: float | None = None
    cleared: bool = False


def store_normals(mesh: bpy.types.Mesh) -> None:
    """Store whether a mesh was built with the recovered normals.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        A new mesh.
    """
    mesh[_BUILT_NORMALS] = NORMAL in mesh.attributes


def shading_choice(mesh: bpy.types.Mesh) -> ShadingChoice | None:
    """Return how the user has shaded a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh of an object of ISC.

    Returns
    -------
    ShadingChoice or None
        None if some of its faces are flat, or edges are sharp that no angle selects.
    """
    faces, edges = _flags(mesh, SHARP_FACE), _flags(mesh, SHARP_EDGE)
    cleared = bool(mesh.get(_BUILT_NORMALS, False)) and NORMAL not in mesh.attributes
    flat, angle = bool(faces.any()), None
    if flat and not faces.all():
        return None
    if edges.any():
        angle = _sharp_angle(mesh, edges)
        if angle is None:
            return None
    return ShadingChoice(flat, angle, cleared)


def shade(mesh: bpy.types.Mesh, choice: ShadingChoice) -> None:
    """Shade a new mesh as another one was.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The new mesh.
    choice : ShadingChoice
        Of the other one.
    """
    if choice.cleared and NORMAL in mesh.attributes:
        mesh.attributes.remove(mesh.attributes[NORMAL])
    if choice.sharp_angle is not None:
        mesh.set_sharp_from_angle(angle=choice.sharp_angle)
    if choice.flat:
        mesh.shade_flat()


def _flags(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Values of a Boolean attribute; empty without it."""
    attribute = mesh.attributes.get(name)
    found = np.zeros(0 if attribute is None else len(attribute.data), bool)
    if attribute is not None:
        attribute.data.foreach_get("value", found)
    return found


def _sharp_angle(mesh: bpy.types.Mesh, sharp: np.ndarray) -> float | None:
    """The angle, in radians, with which Blender marks exactly the edges `sharp` (E,)."""
    probe = mesh.copy()
    try:
        low, high = 0.0, np.pi
        for _ in range(_HALVINGS):
            angle = (low + high) / 2
            probe.set_sharp_from_angle(angle=angle)
            found = _flags(probe, SHARP_EDGE)
            if np.array_equal(found, sharp):
                return angle
            if np.count_nonzero(found) > np.count_nonzero(sharp):
                low = angle
            else:
                high = angle
        return None
    finally:
        bpy.data.meshes.remove(probe)
