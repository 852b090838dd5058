"""A result as files for other programs: texture sets and meshes."""
