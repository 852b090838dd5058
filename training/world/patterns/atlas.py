"""An atlas of surface patterns: print, weaves, and natural materials, from a seed.

A network that never sees print takes a printed edge for a fold and white letters for a highlight.
A map holds shares of a second colour: 0 is one colour of a palette, 255 another; the colours are
put in when a picture is lit. Each map has random numbers of its own, so that the first maps of a
longer atlas are those of a shorter one.

Limits: the letters are those of the fonts on the machine; other fonts give another atlas. Maps are
flat: no pattern knows the body it will lie on.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from isc_core.errors import InputError

from .canvas import Painting
from .cloth import cloth
from .fields import blotches, gradient, marble, noise
from .geometric import checks, dots, stripes
from .label import label
from .logo import logo
from .patches import patches
from .strokes import strokes
from .text import text
from .wood import wood


class PatternKind(IntEnum):
    """What a map shows."""

    TEXT = 0
    LOGO = 1
    LABEL = 2
    STRIPES = 3
    CHECKS = 4
    DOTS = 5
    WOOD = 6
    CLOTH = 7
    NOISE = 8
    MARBLE = 9
    BLOTCHES = 10
    PATCHES = 11
    GRADIENT = 12
    STROKES = 13


@dataclass(frozen=True, eq=False)
class Atlas:
    """Surface patterns.

    Attributes
    ----------
    maps : (count, side, side) ndarray of uint8
        Share of the second colour, 0 to 255.
    kinds : (count,) ndarray of uint8
        A `PatternKind` each.
    tileable : (count,) ndarray of bool
        Opposite edges fit.
    """

    maps: np.ndarray
    kinds: np.ndarray
    tileable: np.ndarray


_PAINTERS: dict[PatternKind, Callable[[np.random.Generator, int], Painting]] = {
    PatternKind.TEXT: text,
    PatternKind.LOGO: logo,
    PatternKind.LABEL: label,
    PatternKind.STRIPES: stripes,
    PatternKind.CHECKS: checks,
    PatternKind.DOTS: dots,
    PatternKind.WOOD: wood,
    PatternKind.CLOTH: cloth,
    PatternKind.NOISE: noise,
    PatternKind.MARBLE: marble,
    PatternKind.BLOTCHES: blotches,
    PatternKind.PATCHES: patches,
    PatternKind.GRADIENT: gradient,
    PatternKind.STROKES: strokes,
}
# Print is what the networks of today get wrong: it makes up half of an atlas.
_SHARES = {PatternKind.TEXT: 6, PatternKind.LOGO: 3, PatternKind.LABEL: 3, PatternKind.PATCHES: 2}
_PRINT = (PatternKind.TEXT, PatternKind.LOGO)
_GROUNDS = (
    PatternKind.STRIPES,
    PatternKind.NOISE,
    PatternKind.PATCHES,
    PatternKind.GRADIENT,
    PatternKind.BLOTCHES,
)
_LEAST_SIDE = 32
_LEAST_DEVIATION = 0.04


def make_atlas(seed: int, count: int, side: int = 128) -> Atlas:
    """Draw an atlas.

    Parameters
    ----------
    seed : int
    count : int
        Number of maps.
    side : int
        Pixels of a map's side, 32 or more.

    Returns
    -------
    Atlas
        The same on a machine with the same fonts.

    Raises
    ------
    InputError
        If there is no map to draw, or it is too small for letters.
    """
    if count < 1 or side < _LEAST_SIDE:
        raise InputError(
            f"{count} patterns of {side} pixels cannot be drawn: ask for one or more, of "
            f"{_LEAST_SIDE} pixels or more"
        )
    maps = np.empty((count, side, side), np.uint8)
    kinds, tileable = np.empty(count, np.uint8), np.empty(count, bool)
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        kinds[k] = _kind(rng)
        maps[k], tileable[k] = _painted(PatternKind(kinds[k]), rng, side)
    return Atlas(maps, kinds, tileable)


def _kind(rng: np.random.Generator) -> PatternKind:
    shares = np.array([_SHARES.get(kind, 1) for kind in PatternKind], float)
    return PatternKind(int(rng.choice(len(shares), p=shares / shares.sum())))


def _painted(kind: PatternKind, rng: np.random.Generator, side: int) -> tuple[np.ndarray, bool]:
    """One map as uint8, and whether it tiles; it is drawn again if it shows nothing."""
    while True:
        values, tileable = _drawn(kind, rng, side)
        if values.std() > _LEAST_DEVIATION:
            return np.asarray(np.rint(255 * values), np.uint8), tileable


def _drawn(kind: PatternKind, rng: np.random.Generator, side: int) -> Painting:
    values, tileable = _PAINTERS[kind](rng, side)
    if kind in _PRINT and rng.random() < 0.25:
        ground = _PAINTERS[PatternKind(int(rng.choice(_GROUNDS)))](rng, side)
        values = values + (1 - values) * ground.values * rng.uniform(0.2, 0.6)
        tileable = tileable and ground.tileable
    if rng.random() < 0.5:
        values = 1 - values
    return Painting(np.clip(values, 0, 1), tileable)
