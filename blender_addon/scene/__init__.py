"""What ISC builds in Blender, one kind of datablock a module.

Every function can be called again: it finds what it has built before, by custom properties, and
updates it. Blender's axes are x right, y away from the viewer, z up: a vector (x, y, z) of the
camera frame becomes (x, -z, y).
"""

from .build import BuildOptions, BuiltObject, build_object, find_built
from .provenance import is_isc_datablock

__all__ = ["BuildOptions", "BuiltObject", "build_object", "find_built", "is_isc_datablock"]
