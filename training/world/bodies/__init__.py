"""Triangle bodies to learn from: furniture, invented rigid bodies, scans, bodies built with Blender
and the shape families of `synth`, taken apart into single things and screened.
"""

from .body import Body, Source
from .sources import BodyFolders, BodyReference, body_names

__all__ = ["Body", "BodyFolders", "BodyReference", "Source", "body_names"]
