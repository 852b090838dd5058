"""Relief of known octaves: height maps of bumps, ridges, weave, dents, scratches, text and cells.

Problem: how much of a relief a method finds depends on its wavelength. Each map therefore has all
`OCTAVES`, each at a strength that is drawn, whatever its pattern.

Equation: a pattern is divided into octaves by windows in the logarithm of the frequency f (cycles a
pixel), which add up to one between the centres,

    W_k(f) = cos^2(pi / 2 log2(f w_k))  for |log2(f w_k)| < 1, else 0,   w_k = 16, 8, 4 pixels

and octave k is scaled until its RMS slope is s_k. Derivatives are those of the Fourier series, so
that slopes and heights agree exactly.

Limits: maps are square and tile. Filtering rounds the edges of text and threads; a sparse pattern
is steeper where it is than its RMS slope over the whole map.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy import ndimage

from training.world.patterns.canvas import filtered_noise
from training.world.patterns.text import text

OCTAVES = (16, 8, 4)  # wavelengths in the middle of each, pixels
_FINEST = 3  # pixels: scratches are drawn no thinner


class ReliefKind(StrEnum):
    """What the relief looks like."""

    BUMPS = "bumps"
    RIDGES = "ridges"
    WEAVE = "weave"
    DENTS = "dents"
    SCRATCHES = "scratches"
    TEXT = "text"
    CELLS = "cells"


@dataclass(frozen=True, eq=False)
class ReliefMap:
    """A height map that tiles, one pixel of the photo a pixel.

    Attributes
    ----------
    height : (side, side) ndarray
        Pixels.
    slope : (2, side, side) ndarray
        Its derivatives along the columns (u) and the rows (v).
    """

    height: np.ndarray
    slope: np.ndarray


def draw_relief(
    kind: ReliefKind, slopes: tuple[float, ...], rng: np.random.Generator, side: int
) -> ReliefMap:
    """Draw a relief.

    Parameters
    ----------
    kind : ReliefKind
    slopes : tuple of float
        RMS slope in each of `OCTAVES`.
    rng : numpy.random.Generator
    side : int
        Pixels, 64 or more.

    Returns
    -------
    ReliefMap
    """
    spectrum = np.fft.rfft2(_PATTERNS[kind](rng, side))
    v, u = np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None]
    frequency = np.hypot(u, v)
    height = np.zeros_like(spectrum)
    for wavelength, wanted in zip(OCTAVES, slopes, strict=True):
        octave = spectrum * octave_window(frequency, wavelength)
        steep = np.fft.irfft2(2 * np.pi * frequency * octave, (side, side)).std()
        height += octave * (wanted / max(float(steep), 1e-12))
    parts = (height, 2j * np.pi * u * height, 2j * np.pi * v * height)
    found = [np.fft.irfft2(part, (side, side)) for part in parts]
    return ReliefMap(found[0], np.stack(found[1:]))


def octave_window(frequency: np.ndarray, wavelength: float) -> np.ndarray:
    """Return the share of each frequency that belongs to an octave.

    Parameters
    ----------
    frequency : ndarray
        Cycles a pixel.
    wavelength : float
        In the middle of the octave, pixels.

    Returns
    -------
    ndarray
        In [0, 1].
    """
    away = np.log2(np.maximum(frequency * wavelength, 1e-6))
    return np.where(np.abs(away) < 1, np.cos(np.pi / 2 * away) ** 2, 0)


def _bumps(rng: np.random.Generator, side: int) -> np.ndarray:
    return filtered_noise(rng, side, 2)


def _ridges(rng: np.random.Generator, side: int) -> np.ndarray:
    """Wavering ridges along one direction, with noise across them."""
    along = rng.uniform(5, 12)
    noise = filtered_noise(rng, side, 2, 1, (along, 1) if rng.random() < 0.5 else (1, along))
    return noise + 0.15 * filtered_noise(rng, side, 2)


def _weave(rng: np.random.Generator, side: int) -> np.ndarray:
    """Rounded threads over and under each other, two in the longest wavelength."""
    count = side // (OCTAVES[0] // 2) // 4 * 4
    line = (np.arange(side) + 0.5) / side * count
    bend = 0.06 * filtered_noise(rng, side, 4)
    u, v = line[None] + bend, line[:, None] + 0.06 * filtered_noise(rng, side, 4)
    over = (np.floor(u) + np.floor(v)) % int(rng.choice([2, 4])) < 1
    warp, weft = (np.abs(np.sin(np.pi * place)) ** 0.7 for place in (u, v))
    fibres = 0.1 * filtered_noise(rng, side, 0.5, 20)
    return np.where(over, warp * (0.7 + 0.3 * weft), weft * (0.3 + 0.4 * warp)) + fibres


def _dents(rng: np.random.Generator, side: int) -> np.ndarray:
    """Round hollows of all sizes, the deepest at each place, as hammers leave them."""
    height = np.zeros((side, side))
    reach = 2 * OCTAVES[0]
    grid = np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1])
    for radius, share in zip((12, 6, 3), (1.2, 1.0, 0.8), strict=True):
        count = round(share * side * side / (np.pi * radius**2))
        for row, column in rng.integers(0, side, (count, 2)):
            r = radius * rng.uniform(0.7, 1.3)
            bowl = -rng.uniform(0.5, 1) * r * np.clip(1 - (grid / r) ** 2, 0, None)
            rows, columns = (
                np.arange(place - reach, place + reach + 1) % side for place in (row, column)
            )
            at = np.ix_(rows, columns)
            height[at] = np.minimum(height[at], bowl)
    return height


def _scratches(rng: np.random.Generator, side: int) -> np.ndarray:
    """Straight grooves in a few directions, and the fine grain between them."""
    height, middle = np.zeros((side, side)), side // 2
    v, u = np.mgrid[:side, :side] - middle
    directions = rng.uniform(0, np.pi, int(rng.integers(1, 4)))
    for _ in range(side // 6):
        angle = rng.choice(directions) + rng.normal(0, 0.1)
        length, width = rng.uniform(0.1, 0.45) * side, rng.uniform(_FINEST, 9)
        along = np.cos(angle) * u + np.sin(angle) * v
        across = np.cos(angle) * v - np.sin(angle) * u
        box = (np.abs(across) < 2 * width) & (np.abs(along) < length)
        rows, columns = np.nonzero(box)
        shift = rng.integers(0, side, 2)
        at = (rows + shift[0]) % side, (columns + shift[1]) % side
        fade = 1 - (along[box] / length) ** 2
        height[at] -= width * fade * np.exp(-2 * (across[box] / width) ** 2)
    return height + 0.3 * filtered_noise(rng, side, 1)


def _text(rng: np.random.Generator, side: int) -> np.ndarray:
    """Letters cut into or raised from a slightly rough ground."""
    letters = text(rng, side).values
    sign = float(rng.choice([-1, 1]))
    return sign * 4 * letters + 0.25 * filtered_noise(rng, side, 2)


def _cells(rng: np.random.Generator, side: int) -> np.ndarray:
    """Rounded cells with furrows between them, as of leather."""
    height = np.zeros((side, side))
    for size, share in ((20, 1.0), (8, 0.5)):
        count = (side // size) ** 2
        seeds = np.ones((side, side), bool)
        seeds[tuple(rng.integers(0, side, (2, count)))] = False
        tiled = np.tile(seeds, (3, 3))
        distance = ndimage.distance_transform_edt(tiled)[side : 2 * side, side : 2 * side]
        height -= share * np.minimum(distance, size) ** 1.5 / size**0.5
    return height


_PATTERNS: dict[ReliefKind, Callable[[np.random.Generator, int], np.ndarray]] = {
    ReliefKind.BUMPS: _bumps,
    ReliefKind.RIDGES: _ridges,
    ReliefKind.WEAVE: _weave,
    ReliefKind.DENTS: _dents,
    ReliefKind.SCRATCHES: _scratches,
    ReliefKind.TEXT: _text,
    ReliefKind.CELLS: _cells,
}
