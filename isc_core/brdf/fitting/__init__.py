"""Lobes from specular images: how rough an object is, how strong its gloss, where its lights stand,
and how sure that is.
"""

from .fit import fit_lobe
from .result import Interval, LobeFit, LobeFitOptions, LobeLight

__all__ = ["Interval", "LobeFit", "LobeFitOptions", "LobeLight", "fit_lobe"]
