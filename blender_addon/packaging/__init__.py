"""How the extension's zips are built: `python -m blender_addon.packaging`, or `make extension`. No
part of what is installed.

A zip holds this package without `packaging`, `isc_core` as its sub-package, the licence, the
manifest, and the wheels that one platform and one Python need, as they were published. NumPy is not
among them: Blender brings its own.
"""
