"""The location of a new object in a shared scene: on the 3D cursor, and visible.

The middle of its base is at the cursor. If another object would enclose it, as the cube of a new
file would, it is placed to the right of that object, with a gap of a tenth of its own width.

Equation: a surface surrounds a place p by its winding number, with the solid angle of a triangle
whose corners are a, b and c from p,

    w = sum 2 atan2(a.(b x c), |a||b||c| + (a.b)|c| + (b.c)|a| + (c.a)|b|) / (4 pi).

It is 1 in a closed mesh, 0 outside, and -1 in a room, whose normals point inward; above one half,
the object encloses the place. A large mesh is represented by 1000 faces from all over it:
Blender's ray casts first sort all of them, a tenth of a second for 100,000, while the window waits.

Citations: A. Van Oosterom, J. Strackee 1983, doi:10.1109/TBME.1983.325207 (solid angle);
A. Jacobson, L. Kavan, O. Sorkine-Hornung 2013, doi:10.1145/2461912.2461916 (winding numbers of any
mesh).

Limits: of a large mesh, w is known to .01 R/h at the distance h from a surface of radius R, so that
places closer to it than a fiftieth may be taken for either side; worse where a few faces are much
larger than most.
"""

from collections.abc import Iterable
from itertools import pairwise

import bpy
import numpy as np
from mathutils import Matrix, Vector

_MAX_FACES = 1000  # of a mesh that are used
_GOLDEN = 0.618034  # its multiples are spread evenly over [0, 1), and follow no order of faces
_GAP = 0.1
_MAX_STEPS = 16
_SOLID = {"SOLID", "TEXTURED"}


def free_location(
    obj: bpy.types.Object, scene: bpy.types.Scene, bounds: np.ndarray | None = None
) -> Vector:
    """Find the location of a new object.

    Parameters
    ----------
    obj : bpy.types.Object
        The object, unrotated; the bounding box of its mesh is used.
    scene : bpy.types.Scene
        The scene with the 3D cursor; its visible meshes can be in the way.
    bounds : (2, 3) ndarray, optional
        Minimum and maximum corner of what is placed, relative to the object's origin; those of its
        mesh if None.

    Returns
    -------
    Vector
        Location of the object's origin.
    """
    points = np.empty((len(obj.data.vertices), 3), np.float32)
    obj.data.vertices.foreach_get("co", points.ravel())
    points = points if bounds is None else bounds
    low, high = Vector(points.min(0)), Vector(points.max(0))
    middle = (low + high) / 2
    place = scene.cursor.location - Vector((middle.x, middle.y, low.z))
    others = [other for other in scene.objects if other != obj and _is_solid(other)]
    for _ in range(_MAX_STEPS):
        enclosing = next((other for other in others if _encloses(other, place + middle)), None)
        if enclosing is None:
            break
        place.x = _world_bounds(enclosing)[1].x - low.x + _GAP * (high.x - low.x)
    return place


def world_matrix(obj: bpy.types.Object) -> Matrix:
    """Return the transform of an object in the world.

    Parameters
    ----------
    obj : bpy.types.Object
        The object.

    Returns
    -------
    Matrix
        The transform. Blender updates its own later; it is used only where it differs.
    """
    moved = obj.parent is not None or len(obj.constraints) > 0
    return obj.matrix_world if moved else obj.matrix_basis


def _bounds(points: Iterable[Vector]) -> tuple[Vector, Vector]:
    """Minimum and maximum corner of the bounding box of points."""
    columns = list(zip(*points, strict=True))
    return Vector([min(column) for column in columns]), Vector([max(column) for column in columns])


def _world_bounds(obj: bpy.types.Object) -> tuple[Vector, Vector]:
    return _bounds(obj.matrix_world @ Vector(corner) for corner in obj.bound_box)


def _is_solid(obj: bpy.types.Object) -> bool:
    return obj.type == "MESH" and obj.display_type in _SOLID and bool(obj.visible_get())


def _encloses(obj: bpy.types.Object, place: Vector) -> bool:
    """Whether a place is inside the closed surface of an object."""
    low, high = _world_bounds(obj)
    if not all(a <= x <= b for a, x, b in zip(low, place, high, strict=True)):
        return False
    return _winding_number(obj, place) > 0.5


def _winding_number(obj: bpy.types.Object, place: Vector) -> float:
    """The winding number of an object's surface around a point."""
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    triangles, weight = _sample(mesh)
    center = np.array(obj.matrix_world.inverted_safe() @ place)
    return weight * float(_solid_angles(triangles - center).sum()) / (4 * np.pi)


def _sample(mesh: bpy.types.Mesh) -> tuple[np.ndarray, float]:
    """Triangles (T, 3, 3) of a sample of the faces, and how many faces each of these represents."""
    count = len(mesh.polygons)
    if not count:  # nothing but edges, or a mesh in Edit Mode
        return np.zeros((0, 3, 3)), 0.0
    chosen = _sample_indices(count, _MAX_FACES)
    faces = [mesh.polygons[index].vertices[:] for index in chosen]
    fans = [(face[0], *edge) for face in faces for edge in pairwise(face[1:])]
    points = np.empty((len(mesh.vertices), 3), np.float32)
    # By its attribute this is copied whole, otherwise one by one.
    mesh.attributes["position"].data.foreach_get("vector", points.ravel())
    return points[np.array(fans)], count / len(chosen)


def _sample_indices(count: int, most: int) -> list[int]:
    """Indices below `count`: all of them, or one from each of `most` equal parts."""
    if count <= most:
        return list(range(count))
    number = np.arange(most)
    return ((number + number * _GOLDEN % 1) * (count / most)).astype(int).tolist()


def _solid_angles(triangles: np.ndarray) -> np.ndarray:
    """Signed solid angles (T,) of triangles (T, 3, 3) from the origin; steradians."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    far_a, far_b, far_c = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = (a * np.cross(b, c)).sum(1)
    rest = far_a * far_b * far_c + (a * b).sum(1) * far_c + (b * c).sum(1) * far_a
    return 2 * np.arctan2(volume, rest + (c * a).sum(1) * far_b)
