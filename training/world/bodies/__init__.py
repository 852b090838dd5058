"""Triangle meshes for training: furniture, synthetic rigid bodies, scans, bodies built with Blender
and the shape families of `synth`, taken apart into separate items and screened.
"""

from .body import Body, Source
from .sources import BodyFolders, BodyReference, body_names

__all__ = ["Body", "BodyFolders", "BodyReference", "Source", "body_names"]
