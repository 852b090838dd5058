"""Bodies that are built from a seed, one kind a module; `build` makes one by its kind's name.

Each module has `make(rng) -> Surface`: y up, any size. Those that use Blender import `bpy` inside
their functions.
"""

from collections.abc import Callable
from zlib import crc32

import numpy as np

from isc_core.errors import InputError

from ..geometry.surface import Surface
from . import cloth, fruit, lathes, paper, rocks

CREDIT = "made by training.world.bodies.built"
_MAKERS: dict[str, Callable[[np.random.Generator], Surface]] = {
    "cloth": cloth.make,
    "fruit": fruit.make,
    "lathe": lathes.make,
    "paper": paper.make,
    "rock": rocks.make,
}
KINDS: tuple[str, ...] = tuple(_MAKERS)


def build(kind: str, number: int) -> Surface:
    """Build a body; the same for the same kind and number.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    number : int
        Number of the body, the random seed.

    Returns
    -------
    Surface
        y up, any size.

    Raises
    ------
    InputError
        For an unknown kind.
    """
    if kind not in _MAKERS:
        raise InputError(f"unknown kind of body {kind!r}: choose {', '.join(_MAKERS)}")
    return _MAKERS[kind](np.random.default_rng([crc32(b"built"), crc32(kind.encode()), number]))
