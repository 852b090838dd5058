"""Albedo textures of several families, drawn from a random generator, or a user's own image.

Each family is a module. Textures are linear Rec.709, row 0 at v = 0, and periodic in u. Lengths are
measured in heights of the texture; the period of u is `ASPECT`, about the ratio on most objects.

Limits: textures follow u and v, so patterns become narrower toward the poles of a swept shape. All
channels are between `DARKEST` and `BRIGHTEST`, as for real materials (soot .03, fresh white paint
.9).
"""

from collections.abc import Callable

import numpy as np

from isc_core.errors import InputError

from . import grey, near_grey, noise, patches, prints, uniform
from .fields import ASPECT
from .image import image_albedo

__all__ = ["ALBEDOS", "ASPECT", "BRIGHTEST", "DARKEST", "image_albedo", "make_albedo"]

DARKEST, BRIGHTEST = 0.02, 0.9
SMALLEST, LARGEST = 16, 4096
_FAMILIES: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "uniform": uniform.texture,
    "patches": patches.texture,
    "print": prints.texture,
    "noise": noise.texture,
    "near_grey": near_grey.texture,
    "grey": grey.texture,
}
ALBEDOS: tuple[str, ...] = tuple(_FAMILIES)


def make_albedo(name: str, rng: np.random.Generator, size: int = 512) -> np.ndarray:
    """Draw an albedo texture.

    Parameters
    ----------
    name : str
        Its family, one of `ALBEDOS`.
    rng : numpy.random.Generator
        Random numbers.
    size : int, optional
        Side in texels, 16 to 4096; another size gives another pattern.

    Returns
    -------
    (size, size, 3) ndarray of float32
        Linear Rec.709 in [`DARKEST`, `BRIGHTEST`].

    Raises
    ------
    InputError
        For an unknown name or another size.
    """
    if name not in _FAMILIES:
        raise InputError(f"unknown albedo {name!r}: choose {', '.join(ALBEDOS)}")
    if not SMALLEST <= size <= LARGEST:
        raise InputError(
            f"an albedo of {size} x {size} texels cannot be made: choose {SMALLEST} to {LARGEST}"
        )
    return np.clip(_FAMILIES[name](rng, size), DARKEST, BRIGHTEST).astype(np.float32)
