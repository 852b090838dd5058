"""Surfaces made of parts: ropes, stitches, scales, pebbles, seeds, hair and petals.

Problem: relief of `relief_maps` is limited to octaves, and has no creases. Ropes, seeds or petals
consist of parts of 8 to 40 pixels that end in folds and steps.

Equation: part k, at the place p_k, has the local coordinates x along and y across it, and

    q = hypot(x / a_k, y / b_k),   h_k = z_k + t_k x + c_k sqrt(1 - q^2)   for q < 1

The height is the highest of them, smoothed by a Gaussian of .7 pixels, and the part of a pixel is
the one that is highest there. With the horizon's elevations e_i of 8 directions, from the plane of
the smooth surface, the share of even light from above that reaches a point is

    V = mean_i cos^2 e_i,

and with the light that its surroundings of the same albedo A reflect, V / (1 - A (1 - V)).

Citation: N. Max, "Horizon mapping: shadows for bump-mapped surfaces", The Visual Computer 4, 1988,
doi:10.1007/BF01905562.

Limits: the surface does not move: parts hide nothing, and the outline stays smooth.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from scipy import ndimage

_SMOOTH = 0.7  # pixels
_FLOOR = -1.0  # height between parts, of a part's half width
_AZIMUTHS = 8
_DISTANCES = (1, 2, 3, 5, 8, 12, 17, 24)  # of the horizon, pixels


class PartKind(StrEnum):
    """What the surface consists of."""

    ROPES = "ropes"
    STITCHES = "stitches"
    SCALES = "scales"
    PEBBLES = "pebbles"
    SEEDS = "seeds"
    HAIR = "hair"
    PETALS = "petals"


class Part(NamedTuple):
    """One part: a cap of an ellipsoid; lengths in pixels."""

    right: float
    down: float
    angle: float
    along: float
    across: float
    rise: float
    base: float
    tilt: float


@dataclass(frozen=True, eq=False)
class PartMap:
    """A surface that tiles, one pixel of the photo a pixel.

    Attributes
    ----------
    height : (side, side) ndarray
        Pixels.
    slope : (2, side, side) ndarray
        Its derivatives along the columns (u) and the rows (v).
    part : (side, side) ndarray of int
        From 1; 0 between parts.
    horizon : (8, side, side) float32 ndarray
        Tangent of the horizon's elevation, at least 0, in directions of k / 8 turns from u to v.
    """

    height: np.ndarray
    slope: np.ndarray
    part: np.ndarray
    horizon: np.ndarray

    @property
    def visible(self) -> np.ndarray:
        """V of the module (side, side)."""
        return np.asarray((1 / (1 + self.horizon**2)).mean(axis=0))


def draw_parts(kind: PartKind, rng: np.random.Generator, side: int) -> PartMap:
    """Draw a surface.

    Parameters
    ----------
    kind : PartKind
    rng : numpy.random.Generator
    side : int
        Pixels, 64 or more.

    Returns
    -------
    PartMap
    """
    height, owner = np.full((side, side), -np.inf), np.zeros((side, side), int)
    width = 1.0
    for number, part in enumerate(_PAINTERS[kind](rng, side), start=1):
        _stamp(height, owner, part, number)
        width = part.across
    floor = height[owner > 0].min() if (owner > 0).any() else 0.0
    height[owner == 0] = floor + _FLOOR * width * 0.3
    height = ndimage.gaussian_filter(height, _SMOOTH, mode="wrap")
    slope = [(np.roll(height, -1, axis) - np.roll(height, 1, axis)) / 2 for axis in (1, 0)]
    return PartMap(height, np.stack(slope), owner, _horizon(height))


def _stamp(height: np.ndarray, owner: np.ndarray, part: Part, number: int) -> None:
    """Lay a part on the others, where it is higher."""
    side, reach = len(height), int(np.ceil(max(part.along, part.across))) + 1
    line = np.arange(-reach, reach + 1)
    middle = round(part.down), round(part.right)
    v, u = line[:, None] + middle[0] - part.down, line[None] + middle[1] - part.right
    cosine, sine = np.cos(part.angle), np.sin(part.angle)
    x, y = cosine * u + sine * v, cosine * v - sine * u
    square = (x / part.along) ** 2 + (y / part.across) ** 2
    found = part.base + part.tilt * x + part.rise * np.sqrt(np.maximum(1 - square, 0))
    at = np.ix_((line + middle[0]) % side, (line + middle[1]) % side)
    above = (square < 1) & (found > height[at])
    height[at] = np.where(above, found, height[at])
    owner[at] = np.where(above, number, owner[at])


def _horizon(height: np.ndarray) -> np.ndarray:
    tangent = np.zeros((_AZIMUTHS, *height.shape), np.float32)
    for k, found in enumerate(tangent):
        turn = 2 * np.pi * k / _AZIMUTHS
        for distance in _DISTANCES:
            u, v = round(distance * np.cos(turn)), round(distance * np.sin(turn))
            rise = np.roll(height, (-v, -u), (0, 1)) - height
            np.maximum(found, rise / np.hypot(u, v), out=found)
    return tangent


def _lattice(side: int, right: float, down: float) -> Iterator[tuple[int, int, float, float]]:
    """Rows and columns that tile, about `right` and `down` pixels apart: numbers and places."""
    rows, columns = (max(2, 2 * round(side / step / 2)) for step in (down, right))
    for row in range(rows):
        for column in range(columns):
            yield row, column, column * side / columns, row * side / rows


def _ropes(rng: np.random.Generator, side: int) -> Iterator[Part]:
    """Ropes beside each other, of strands that wind around them."""
    across, step = rng.uniform(18, 40), rng.uniform(8, 14)
    angle, flat = rng.choice([-1, 1]) * rng.uniform(0.5, 0.9), rng.uniform(0.4, 0.9)
    shift = rng.uniform(0, 1, 1000)
    for row, _, u, v in _lattice(side, step, across):
        yield Part(
            u + shift[row] * step,
            v,
            angle,
            0.5 * across / abs(np.sin(angle)),
            0.62 * step,
            flat * 0.5 * across,
            0.0,
            0.0,
        )


def _stitches(rng: np.random.Generator, side: int) -> Iterator[Part]:
    """Knitted stitches: columns of loops that lean to the left and to the right in turn."""
    wide, high = rng.uniform(8, 16), rng.uniform(9, 16)
    lean, flat = rng.uniform(0.4, 0.8), rng.uniform(0.4, 0.9)
    for _, column, u, v in _lattice(side, wide, high):
        turned = np.pi / 2 + (lean if column % 2 else -lean)
        places = rng.normal(0, 0.4, 2)
        yield Part(
            u + places[0],
            v + places[1],
            turned,
            0.75 * high,
            0.48 * wide,
            flat * 0.5 * wide,
            0.0,
            0.1,
        )


def _scales(rng: np.random.Generator, side: int) -> Iterator[Part]:
    """Round scales in rows, each row upon the next."""
    size, tilt = rng.uniform(14, 40), rng.uniform(0.2, 0.6)
    flat = rng.uniform(0.1, 0.4)
    for row, _, u, v in _lattice(side, size, 0.6 * size):
        yield Part(
            u + size / 2 * (row % 2) + rng.normal(0, 0.03) * size,
            v,
            np.pi / 2 + rng.normal(0, 0.05),
            0.62 * size,
            0.58 * size,
            flat * size / 2,
            rng.normal(0, 0.01) * size,
            tilt,
        )


def _pebbles(rng: np.random.Generator, side: int) -> Iterator[Part]:
    """Round stones of several sizes."""
    size, flat = rng.uniform(9, 32), rng.uniform(0.4, 0.9)
    for _, _, u, v in _lattice(side, 0.8 * size, 0.8 * size):
        radius = size / 2 * rng.uniform(0.8, 1.3)
        across = radius * rng.uniform(0.75, 1)
        u, v = np.array([u, v]) + rng.normal(0, 0.15, 2) * size
        rise = flat * across
        yield Part(u, v, rng.uniform(0, np.pi), radius, across, rise, -rise * rng.random() / 3, 0.0)


def _seeds(rng: np.random.Generator, side: int) -> Iterator[Part]:
    """Elongated grains in all directions, upon each other."""
    return _heap(rng, side, rng.uniform(9, 18), rng.uniform(1.6, 2.6), np.pi)


def _hair(rng: np.random.Generator, side: int) -> Iterator[Part]:
    """Thin strands in nearly one direction."""
    return _heap(rng, side, rng.uniform(5, 10), rng.uniform(6, 10), rng.uniform(0.1, 0.3))


def _heap(
    rng: np.random.Generator, side: int, wide: float, longer: float, spread: float
) -> Iterator[Part]:
    flat, first = rng.uniform(0.4, 0.9), rng.uniform(0, np.pi)
    for _ in range(round(2.5 * side**2 / (np.pi / 4 * wide**2 * longer))):
        across = wide / 2 * rng.uniform(0.8, 1.2)
        rise = flat * across
        angle = first + spread * rng.uniform(-1, 1)
        u, v = rng.uniform(0, side, 2)
        base, tilt = rise * rng.uniform(-1, 1), rng.normal(0, 0.08)
        yield Part(u, v, angle, longer * across, across, rise, base, tilt)


def _petals(rng: np.random.Generator, side: int) -> Iterator[Part]:
    """Long leaves, each upon the root of the next; lengths and directions vary."""
    size, tilt, flat = rng.uniform(16, 36), rng.uniform(0.2, 0.5), rng.uniform(0.1, 0.5)
    for row, _, u, v in _lattice(side, 0.8 * size, 1.1 * size):
        places = rng.normal(0, 0.08, 2) * size
        yield Part(
            u + places[0] + 0.4 * size * (row % 2),
            v + places[1],
            np.pi / 2 + rng.normal(0, 0.3),
            size * rng.uniform(0.9, 1.2),
            0.5 * size,
            flat * size / 2,
            rng.normal(0, 0.05) * size,
            tilt,
        )


_PAINTERS: dict[PartKind, Callable[[np.random.Generator, int], Iterator[Part]]] = {
    PartKind.ROPES: _ropes,
    PartKind.STITCHES: _stitches,
    PartKind.SCALES: _scales,
    PartKind.PEBBLES: _pebbles,
    PartKind.SEEDS: _seeds,
    PartKind.HAIR: _hair,
    PartKind.PETALS: _petals,
}
