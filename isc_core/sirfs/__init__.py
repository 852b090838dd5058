"""SIRFS: shape, illumination and reflectance from the shading of one image.

Problem: a diffuse image is reflectance times shading; find the height map and the light whose
shading leaves the most likely reflectance, given statistics of natural shapes, reflectances and
lights.

Citation: J. T. Barron, J. Malik, "Shape, Illumination, and Reflectance from Shading", TPAMI 37(8),
2015, doi:10.1109/TPAMI.2014.2377712.

Pipeline: `recover` crops the object and resamples it to one size (`problem.Problem`); `solver`
minimises the objective over a `pyramid` of heights and a whitened light. The terms are in
`surface`, `reflectance`, `illumination` and `silhouette`; `numpy_engine` evaluates them in plain
NumPy, `numba_engine` by compiled `kernels`, and tests compare the two. `settings` contains the
weights and the starting points, `priors` the statistics, `normal_prior` the term of predicted
normals.

Nothing is re-exported here: the function `recover.recover` would hide its module.
"""
