"""Builds the extension's zips: `python -m blender_addon.packaging`, or `make extension`. Not
installed.

A zip contains this package without `packaging`, `isc_core` as its sub-package, the licence, the
manifest, and the wheels that one platform and one Python version need, as published. NumPy is not
among them: Blender includes its own.
"""
