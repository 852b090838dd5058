"""Where a new object stands in a scene that is not its own: on the 3D cursor, and seen.

The middle of its base is at the cursor. If another object would swallow it, such as the cube of a
new file, it stands beside that one instead, to the right, with a gap of a tenth of its own width.

Limits: an object swallows a place if rays from there along both directions of the three axes leave
through its surface from inside. Rooms are told from bodies by their normals, which point inward.
"""

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Vector

_DIRECTIONS = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
_GAP = 0.1
_MOST_STEPS = 16
_SOLID = {"SOLID", "TEXTURED"}


def free_place(
    obj: bpy.types.Object, scene: bpy.types.Scene, room: np.ndarray | None = None
) -> Vector:
    """Find the location of a new object.

    Parameters
    ----------
    obj : bpy.types.Object
        The object, unrotated; the bounding box of its mesh is used.
    scene : bpy.types.Scene
        The scene with the 3D cursor; its visible meshes can be in the way.
    room : (2, 3) ndarray, optional
        The lowest and the highest corner of what has to find a place, from the object's origin;
        those of its mesh if None.

    Returns
    -------
    Vector
        Location of the object's origin.
    """
    points = np.empty((len(obj.data.vertices), 3), np.float32)
    obj.data.vertices.foreach_get("co", points.ravel())
    points = points if room is None else room
    low, high = Vector(points.min(0)), Vector(points.max(0))
    middle = (low + high) / 2
    place = scene.cursor.location - Vector((middle.x, middle.y, low.z))
    others = [other for other in scene.objects if other != obj and _is_solid(other)]
    for _ in range(_MOST_STEPS):
        swallower = next((other for other in others if _swallows(other, place + middle)), None)
        if swallower is None:
            break
        place.x = _world_bounds(swallower)[1].x - low.x + _GAP * (high.x - low.x)
    return place


def _bounds(points: Iterable[Vector]) -> tuple[Vector, Vector]:
    """The lowest and the highest corner of a box around points."""
    columns = list(zip(*points, strict=True))
    return Vector([min(column) for column in columns]), Vector([max(column) for column in columns])


def _world_bounds(obj: bpy.types.Object) -> tuple[Vector, Vector]:
    return _bounds(obj.matrix_world @ Vector(corner) for corner in obj.bound_box)


def _is_solid(obj: bpy.types.Object) -> bool:
    return obj.type == "MESH" and obj.display_type in _SOLID and bool(obj.visible_get())


def _swallows(obj: bpy.types.Object, place: Vector) -> bool:
    """Whether a place is inside the closed surface of an object."""
    low, high = _world_bounds(obj)
    if not all(a <= x <= b for a, x, b in zip(low, place, high, strict=True)):
        return False
    to_local = obj.matrix_world.inverted_safe()
    start = to_local @ place
    for direction in _DIRECTIONS:
        ray = to_local.to_3x3() @ Vector(direction)
        hit, _, normal, _ = obj.ray_cast(start, ray)
        if not hit or normal.dot(ray) <= 0:
            return False
    return True
