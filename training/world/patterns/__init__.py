"""Grey surface patterns that bodies are textured with while a network learns."""

from .atlas import Atlas, PatternKind, make_atlas

__all__ = ["Atlas", "PatternKind", "make_atlas"]
