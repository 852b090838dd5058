"""Solids from the visible side of an object: a smooth outline, a side and a back."""
