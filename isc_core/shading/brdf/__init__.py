"""Reflectance models, one a file, and operations on any of them.

A model is a frozen dataclass of its parameters. `value(normal, view, light)` is the bidirectional
reflectance distribution function f_r (1/sr), the radiance toward the view per irradiance from the
light; `gradient(normal, view, light)` holds its derivatives, a field for each parameter, under the
parameter's name. Directions are unit vectors (..., 3) that point away from the surface and
broadcast with each other; parameters are numbers, or arrays that broadcast with the directions'
(...). Below the horizon both are 0.

`energy` measures albedo and reciprocity, `roughness` converts between the models' measures of
gloss; `shading.radiance` turns reflectance into radiance.
"""
