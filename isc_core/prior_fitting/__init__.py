"""Fitting the statistics of SIRFS (Barron & Malik 2015) to objects whose shape, reflectance and
light are known.

`training` reads the objects, `statistics` condenses each of them once, `fit` turns any selection of
them into a `prior_set.PriorSet`; `prior_set` and what it needs are all that a solver imports.
"""
