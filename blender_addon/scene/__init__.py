"""What ISC builds in Blender, one module a noun: collection, mesh, images, material, world, sun,
camera, background, provenance.

Every function can be called again: it finds what it made before, by custom properties, and updates
it. Blender's axes are x right, y away from the viewer, z up: the camera's frame (x, y, z) becomes
(x, -z, y).
"""

from .build import BuildOptions, Built, build, find, is_isc

__all__ = ["BuildOptions", "Built", "build", "find", "is_isc"]
