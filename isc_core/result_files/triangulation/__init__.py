"""Triangles over the pixels of a height map, and the normals of their vertices."""
