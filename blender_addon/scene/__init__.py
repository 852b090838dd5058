"""What ISC builds in Blender, one module per kind of datablock.

Every function can be called again: it finds what it built before by custom properties, and updates
it. Blender's axes are x right, y away from the viewer, z up: a vector (x, y, z) of the
camera frame becomes (x, -z, y).
"""

from ..datablocks.provenance import is_isc_datablock
from .build import build_object
from .built_object import BuiltObject, find_built
from .preparation import BuildOptions

__all__ = ["BuildOptions", "BuiltObject", "build_object", "find_built", "is_isc_datablock"]
