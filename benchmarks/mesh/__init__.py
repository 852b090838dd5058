"""Measurements of the mesh of a result."""
