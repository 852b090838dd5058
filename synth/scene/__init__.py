"""One scene as plain numbers: object, material, lights and camera, and what the camera's rays hit.

`camera`, `meshes`, `materials` and `lights` describe it, `scene` holds them together, `tracing` and
`surface` find the visible points with Mitsuba (`variant`).
"""

from .scene import Scene

__all__ = ["Scene"]
