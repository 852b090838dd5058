"""Paint on surfaces that consist of parts, and print that shows such surfaces.

Problem: a picture of ropes is not ropes. Print shows the same parts as `part_maps`, flat, in one of
three styles: each part in one of a few colours; a dark line along the edge of each; or a picture
of the surface, shaded under a light of its own.
"""

from enum import StrEnum

import numpy as np
from scipy import ndimage

from .part_maps import PartMap
from .print_maps import draw_colour

_MOST_COLOURS = 4
_AMBIENT = 0.4  # share of the even light in a picture


class PartPrint(StrEnum):
    """How print shows parts."""

    COLOURS = "colours"
    LINES = "lines"
    PICTURE = "picture"


def varied_paint(parts: PartMap, colour: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return one paint, or one that differs slightly between parts.

    Parameters
    ----------
    parts : PartMap
    colour : (3,) ndarray
    rng : numpy.random.Generator

    Returns
    -------
    (side, side, 3) ndarray
        Linear, in (0, 1).
    """
    varied = rng.random() < 0.5
    brightness, chroma = (rng.uniform(0.03, 0.15), rng.uniform(0, 0.06)) if varied else (0.0, 0.0)
    count = int(parts.part.max()) + 1
    apart = brightness * rng.standard_normal((count, 1)) + chroma * rng.standard_normal((count, 3))
    return np.clip(colour * np.exp(apart)[parts.part], 0.01, 0.95)


def draw_part_print(
    parts: PartMap, number: int, rng: np.random.Generator
) -> tuple[np.ndarray, PartPrint]:
    """Draw a reflectance map that shows parts.

    Parameters
    ----------
    parts : PartMap
    number : int
        Of the body; decides the style.
    rng : numpy.random.Generator

    Returns
    -------
    paint : (side, side, 3) ndarray
        Linear, in (0, 1).
    style : PartPrint
    """
    style = list(PartPrint)[number % len(PartPrint)]
    ground, ink = draw_colour(rng), draw_colour(rng) * rng.uniform(0.1, 1)
    if style == PartPrint.COLOURS:
        colours = np.stack([draw_colour(rng) for _ in range(int(rng.integers(2, _MOST_COLOURS)))])
        chosen = rng.integers(0, len(colours), int(parts.part.max()) + 1)
        paint = np.where(parts.part[..., None] > 0, colours[chosen][parts.part], ink)
    elif style == PartPrint.LINES:
        size = int(rng.integers(2, 4))
        highest = ndimage.maximum_filter(parts.part, size, mode="wrap")
        edge = highest != ndimage.minimum_filter(parts.part, size, mode="wrap")
        paint = np.where(edge[..., None], ink, ground)
    else:
        paint = ground * _shaded(parts, rng)[..., None]
    smooth = ndimage.gaussian_filter(paint.astype(float), (0.5, 0.5, 0), mode="wrap")
    return np.clip(smooth, 0.01, 0.95), style


def _shaded(parts: PartMap, rng: np.random.Generator) -> np.ndarray:
    """Brightness (side, side) of a picture of the surface, in (0, 1)."""
    turn, height = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.2)
    lean = np.array([np.cos(turn), np.sin(turn)]) * np.cos(height)
    right, down = parts.slope
    level = (np.sin(height) - lean[0] * right - lean[1] * down) / np.sqrt(1 + right**2 + down**2)
    return np.asarray(_AMBIENT * parts.visible + (1 - _AMBIENT) * np.clip(level, 0, 1))
