"""Simple decompositions for comparison with SIRFS: one method per file, and `estimate`, which
imports a method by name.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from .from_shading import BaselineEstimate

_MODULES = {
    "naive": ".naive",
    "retinex": ".retinex",
    "sfs-tsai-shah": ".tsai_shah_1994",
    "sfs-ikeuchi-horn": ".ikeuchi_horn_1981",
}
METHODS = tuple(_MODULES)


def estimate(method: str, log_image: np.ndarray, mask: np.ndarray) -> BaselineEstimate:
    """Estimate shape, shading and light with a method's defaults.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    log_image : (H, W, 3) ndarray
        Natural logarithm of a linear diffuse image, finite in the mask.
    mask : (H, W) bool ndarray

    Returns
    -------
    BaselineEstimate

    Raises
    ------
    InputError
        For an unknown method, and for arrays of wrong shapes.
    """
    if method not in METHODS:
        raise InputError(f"unknown model {method!r}: choose one of {', '.join(METHODS)}")
    found: BaselineEstimate = import_module(_MODULES[method], __package__).estimate(log_image, mask)
    return found
