"""Filters of images: averages, extrema, morphology, components, distances, splines.

Importing `scipy.ndimage` takes a tenth of the time of a whole decomposition of a photo, because it
also imports `scipy.special` and parses the documentation of every function. The few filters that a
photo needs are therefore here, as NumPy operations or compiled loops, and so are its sparse
matrices, in `numerics.ellpack`. The tests compare each with SciPy, to the last bit where sums have
an order. Modules that do not run for a plain photo use SciPy.

Equal inputs give equal bytes on any number of threads.
"""
