"""What objects are painted with: albedo textures of several families, all from a random generator;
or a user's own image.

A family is a file here. Textures are linear Rec.709, row 0 at v = 0, and go on without a seam from
u = 1 to u = 0. Their lengths are measured in the height of the texture; going around u is `ASPECT`
of them, about what it is on most objects.

Limits: painted on by u and v, so patterns narrow toward the poles of a swept shape, as a wrapped
label would crease. No paint reflects less than `DARKEST` or more than `BRIGHTEST` of any colour:
real ones do neither (soot .03, fresh white paint .9).
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
    """A texture of the family `name`, one of `ALBEDOS`: (size, size, 3) float32, linear Rec.709
    from `DARKEST` to `BRIGHTEST`.

    `size`: 16 to 4096; the same seed gives another picture in another size. Raises `InputError` for
    another size and for unknown names.
    """
    if name not in _FAMILIES:
        raise InputError(f"unknown albedo {name!r}: choose {', '.join(ALBEDOS)}")
    if not SMALLEST <= size <= LARGEST:
        raise InputError(
            f"an albedo of {size} x {size} texels cannot be made: choose {SMALLEST} to {LARGEST}"
        )
    return np.clip(_FAMILIES[name](rng, size), DARKEST, BRIGHTEST).astype(np.float32)
