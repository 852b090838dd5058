"""Print, wood and cloth as paint: reflectance maps for smooth bodies.

Problem: a dark line is not a groove. What lies on these bodies has edges as fine as the relief of
`relief_maps`, and no shape.

Limits: maps are square; those that do not tile show an edge where they repeat.
"""

from collections.abc import Callable
from enum import StrEnum

import numpy as np

from training.world.patterns.canvas import Painting
from training.world.patterns.cloth import cloth
from training.world.patterns.geometric import checks, stripes
from training.world.patterns.label import label
from training.world.patterns.logo import logo
from training.world.patterns.text import text
from training.world.patterns.wood import wood
from training.world.random_draws import log_uniform

_WHITE, _BLACK = (0.7, 0.9), (0.02, 0.08)
_BROWN = np.array([[0.55, 0.33, 0.17], [0.2, 0.1, 0.045]])  # early and late wood, linear


class PrintKind(StrEnum):
    """What is painted."""

    TEXT = "text"
    LABEL = "label"
    BLACK_ON_WHITE = "black on white"
    COLOURED = "coloured print"
    WOOD = "wood"
    CLOTH = "cloth"


def draw_print(kind: PrintKind, rng: np.random.Generator, side: int) -> np.ndarray:
    """Draw a reflectance map.

    Parameters
    ----------
    kind : PrintKind
    rng : numpy.random.Generator
    side : int
        Pixels.

    Returns
    -------
    (side, side, 3) ndarray
        Linear, in (0, 1).
    """
    painters = _PAINTERS[kind]
    share = np.clip(painters[int(rng.integers(len(painters)))](rng, side).values, 0, 1)
    ground, ink = _colours(kind, rng)
    return ground + share[..., None] * (ink - ground)


def draw_colour(rng: np.random.Generator) -> np.ndarray:
    """Draw a paint: of any hue, pale or strong.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    (3,) ndarray
        Linear, in (0, 1).
    """
    hue, saturation = rng.uniform(0, 6), rng.uniform(0, 0.85)
    pure = np.clip(2 - np.abs((hue - np.array([0.0, 2.0, 4.0]) + 3) % 6 - 3), 0, 1)
    return np.clip(log_uniform(rng, 0.2, 0.8) * (1 - saturation * (1 - pure)), 0.02, 0.9)


def _colours(kind: PrintKind, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The colours where a map is 0 and 1."""
    if kind == PrintKind.WOOD:
        early, late = _BROWN * rng.uniform(0.7, 1.4, (2, 1)) * rng.uniform(0.9, 1.1, 3)
        return early, late
    white, black = np.full(3, rng.uniform(*_WHITE)), np.full(3, rng.uniform(*_BLACK))
    if kind == PrintKind.BLACK_ON_WHITE:
        return white, black
    ground, ink = draw_colour(rng), (black, white, draw_colour(rng))[int(rng.integers(3))]
    return (ink, ground) if rng.random() < 0.5 else (ground, ink)


_PAINTERS: dict[PrintKind, tuple[Callable[[np.random.Generator, int], Painting], ...]] = {
    PrintKind.TEXT: (text,),
    PrintKind.LABEL: (label,),
    PrintKind.BLACK_ON_WHITE: (text, label, logo, stripes),
    PrintKind.COLOURED: (logo, label, stripes, checks),
    PrintKind.WOOD: (wood,),
    PrintKind.CLOTH: (cloth,),
}
