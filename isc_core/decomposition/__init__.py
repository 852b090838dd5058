"""The pipeline: from one photo to its intrinsic scene characteristics."""

from ..scene.known_inputs import KnownInputs
from .pipeline import decompose
from .settings import Settings

__all__ = ["KnownInputs", "Settings", "decompose"]
