"""Bodies that are built from a seed, one kind a module; `build` makes one by its kind's name.

Each module has `make(rng) -> Surface`: y up, any size. Those that use Blender import `bpy` inside
their functions.
"""

from collections.abc import Callable
from zlib import crc32

import numpy as np

from isc_core.errors import InputError

from ..geometry.surface import Surface, in_fixed_order
from . import (
    assemblies,
    booleans,
    boxes,
    cloth,
    creatures,
    faces,
    figurines,
    fruit,
    fuzzy,
    lathes,
    lettering,
    metaballs,
    paper,
    plants,
    pouches,
    rocks,
    shells,
    skins,
    thin,
)

CREDIT = "made by training.world.bodies.built"
_MAKERS: dict[str, Callable[[np.random.Generator], Surface]] = {
    "assembly": assemblies.make,
    "boolean": booleans.make,
    "box": boxes.make,
    "cloth": cloth.make,
    "creature": creatures.make,
    "face": faces.make,
    "figurine": figurines.make,
    "fruit": fruit.make,
    "fuzzy": fuzzy.make,
    "lathe": lathes.make,
    "lettering": lettering.make,
    "metaball": metaballs.make,
    "paper": paper.make,
    "plant": plants.make,
    "pouch": pouches.make,
    "rock": rocks.make,
    "shell": shells.make,
    "skin": skins.make,
    "thin": thin.make,
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
    rng = np.random.default_rng([crc32(b"built"), crc32(kind.encode()), number])
    return in_fixed_order(_MAKERS[kind](rng))
