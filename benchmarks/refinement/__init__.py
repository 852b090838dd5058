"""Measurements of `isc refine` on rendered scenes that no fit has seen."""
