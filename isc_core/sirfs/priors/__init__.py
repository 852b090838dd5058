"""Statistics of natural shapes, reflectances and lights: the priors of SIRFS, and their files.

`prior_set.PriorSet` is the compact form that is fitted and stored (`prior_file`); its method
`priors` builds the tables that the solver reads (`priors.Priors`). `absolute_table`,
`color_mixture`, `scale_mixture` and `lights` are the parts; `light_posterior` multiplies the prior
of the light by the network's prediction for the photo.
"""

from .prior_file import load_prior_set, save_prior_set, shipped_prior_set
from .prior_set import PriorSet
from .priors import Priors

__all__ = ["PriorSet", "Priors", "load_prior_set", "save_prior_set", "shipped_prior_set"]
