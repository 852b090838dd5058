"""Export of a result for other programs: texture sets and meshes."""
