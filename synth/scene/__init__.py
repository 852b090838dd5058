"""A scene as plain numbers: object, material, lights and camera, and the surface that the camera
sees.

`camera`, `meshes`, `materials` and `lights` describe it, `scene` combines them, `tracing` and
`surface` find the visible points with Mitsuba (`variant`).
"""

from .scene import Scene

__all__ = ["Scene"]
