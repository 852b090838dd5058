"""Measurements of `isc decompose` on rendered photos of objects on tables."""
