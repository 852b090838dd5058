"""Lobes from specular images: how rough an object is, how strong its gloss, where its lights stand,
and how sure that is.
"""

from ..scene.lobe_fit import Interval, LobeFit, LobeFitOptions, LobeLight
from .fit import fit_lobe

__all__ = ["Interval", "LobeFit", "LobeFitOptions", "LobeLight", "fit_lobe"]
