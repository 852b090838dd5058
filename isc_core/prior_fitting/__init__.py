"""Fitting the statistics of SIRFS (Barron & Malik 2015) to objects whose shape, reflectance and
light are known.

`training_objects` reads the objects, `statistics` condenses each of them once, `fit` turns any
selection of them into a `PriorSet`; `cross_validation` scores a selection on the others. Solvers
import `sirfs.priors` only.
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
