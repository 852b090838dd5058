"""Fitting the statistics of SIRFS (Barron & Malik 2015) to objects whose shape, reflectance and
light are known.

`training_objects` reads the objects, `statistics` computes the statistics of each object once,
`fit` fits a `PriorSet` to any selection of them; `cross_validation` evaluates a selection on the
other objects. Solvers import `sirfs.priors` only.
"""

from .fit import FitOptions, LightFitOptions, fit_photo_priors, fit_priors
from .statistics import ObjectStatistics, TrainingObject, collect_statistics
from .training_objects import read_training_objects

__all__ = [
    "FitOptions",
    "LightFitOptions",
    "ObjectStatistics",
    "TrainingObject",
    "collect_statistics",
    "fit_photo_priors",
    "fit_priors",
    "read_training_objects",
]
