"""Statistics of natural shapes, reflectances and lights: the priors of SIRFS, and their files."""
