"""Vessels: cups, bowls, vases, bottles, goblets, pots, with walls, handles, spouts and relief.

Equation: an outer profile (radius, height) through random points is closed by the same profile
moved inward by the wall's thickness, and revolved around the y axis. Relief is a factor of the
radius: flutes, twists, grooves, facets.
"""

from collections.abc import Callable

import numpy as np

from ..geometry.forms import curve, displaced, placed, revolved, tube
from ..geometry.noise import noise
from ..geometry.surface import Surface, together

Relief = Callable[[np.ndarray, np.ndarray], np.ndarray]
# Radius at heights from foot to rim, relative to the height, and the range of the height.
_OUTLINES: dict[str, tuple[list[float], tuple[float, float]]] = {
    "mug": ([0.42, 0.44, 0.44, 0.44, 0.45], (0.8, 1.4)),
    "cup": ([0.25, 0.42, 0.52, 0.57, 0.6], (0.7, 1.0)),
    "bowl": ([0.45, 0.8, 1.0, 1.1, 1.15], (0.8, 1.2)),
    "vase": ([0.3, 0.45, 0.5, 0.3, 0.25], (1.4, 2.2)),
    "jar": ([0.45, 0.6, 0.65, 0.55, 0.4], (1.0, 1.5)),
    "bottle": ([0.28, 0.3, 0.3, 0.13, 0.11], (1.6, 2.4)),
    "goblet": ([0.4, 0.07, 0.07, 0.4, 0.42], (1.4, 1.9)),
    "plate": ([1.6, 2.6, 3.4, 3.9, 4.2], (0.25, 0.4)),
    "pot": ([0.42, 0.48, 0.53, 0.56, 0.6], (0.9, 1.2)),
}
_HANDLED = {"mug": 0.9, "cup": 0.7, "jar": 0.4, "bottle": 0.1, "vase": 0.3, "pot": 0.3}


def make(rng: np.random.Generator) -> Surface:
    """Make a vessel.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    name = str(rng.choice(list(_OUTLINES)))
    widths, heights = _OUTLINES[name]
    height = rng.uniform(*heights)
    radii = np.array(widths) * np.exp(rng.normal(0, 0.1, len(widths)))
    points = np.stack([radii * height, np.linspace(0, 1, len(widths)) * height], -1)
    outer = curve(points, 70)
    body = revolved(_walled(outer, rng), int(rng.integers(110, 160)), _relief(rng, name))
    if rng.random() < 0.3:
        body = displaced(body, rng.uniform(0.002, 0.012) * noise(body.vertices, 3, rng))
    parts = [body]
    if rng.random() < _HANDLED.get(name, 0):
        parts += _handles(outer, rng)
    if name in ("mug", "jar", "pot") and rng.random() < 0.25:
        parts.append(_spout(outer, rng))
    if name in ("jar", "pot", "bottle") and rng.random() < 0.5:
        parts.append(_lid(outer, rng))
    return together(parts)


def _walled(outer: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The outer profile, a rounded rim, the inside and the floor, from axis to axis."""
    wall = rng.uniform(0.02, 0.06) * np.ptp(outer[:, 1])
    foot = np.array([[0, 0.0], [0.8 * outer[0, 0], 0.0], [0.86 * outer[0, 0], -0.35 * wall]])
    turn = np.linspace(0, np.pi, 9)[1:-1, None]
    rim = outer[-1] - (wall / 2, 0) + wall / 2 * np.hstack([np.cos(turn), np.sin(turn)])
    inner = np.stack([np.maximum(outer[:, 0] - wall, 0.3 * wall), outer[:, 1]], -1)[::-1]
    inner = inner[inner[:, 1] > wall]
    floor = np.array([[0.5 * inner[-1, 0], wall], [0, wall]])
    if rng.random() < 0.15:  # filled up, like a candle
        level = rng.uniform(0.5, 0.95) * outer[-1, 1]
        inner = inner[inner[:, 1] > level]
        floor = np.array([[0.5 * outer[-1, 0], level], [0, level]])
    return np.concatenate([foot, outer, rim, inner, floor])


def _relief(rng: np.random.Generator, name: str) -> Relief | None:
    """Factor of the radius by row and angle; none on half of the vessels."""
    style = int(rng.integers(8))
    count, amount = int(rng.integers(5, 40)), rng.uniform(0.01, 0.05)
    twist = rng.uniform(-0.06, 0.06) if rng.random() < 0.5 else 0.0

    def flutes(row: np.ndarray, angle: np.ndarray) -> np.ndarray:
        return np.asarray(1 + amount * np.abs(np.sin(count * (angle + twist * row) / 2)))

    def grooves(row: np.ndarray, angle: np.ndarray) -> np.ndarray:
        return np.asarray(1 + 0.6 * amount * np.sin(row * 0.9) + 0 * angle)

    def facets(row: np.ndarray, angle: np.ndarray) -> np.ndarray:
        sides = 3 + count % 9
        part = np.mod(angle + twist * row, 2 * np.pi / sides) - np.pi / sides
        return np.asarray(np.cos(np.pi / sides) / np.cos(part))

    styles: dict[int, Relief] = {0: flutes, 1: grooves, 2: facets}
    return styles.get(style) if name != "plate" or style == 0 else None


def _handles(outer: np.ndarray, rng: np.random.Generator) -> list[Surface]:
    """One handle, or two opposite ones."""
    low, high = int(rng.uniform(0.15, 0.35) * len(outer)), int(rng.uniform(0.7, 0.92) * len(outer))
    (r0, y0), (r1, y1) = outer[low], outer[high]
    reach = rng.uniform(0.35, 0.7) * (y1 - y0)
    points = np.array(
        [
            [r0 - 0.02, y0, 0],
            [r0 + 0.7 * reach, y0 + 0.1 * (y1 - y0), 0],
            [max(r0, r1) + reach, (y0 + y1) / 2 + 0.1 * (y1 - y0), 0],
            [r1 + 0.7 * reach, y1, 0],
            [r1 - 0.02, y1, 0],
        ]
    )
    width = rng.uniform(0.05, 0.09) * (y1 - y0)
    handle = tube(curve(points, 48), np.full(48, width), 20, rng.uniform(0.8, 2.0))
    half_turn = np.diag([-1.0, 1, -1])
    return [handle, placed(handle, turn=half_turn)] if rng.random() < 0.25 else [handle]


def _spout(outer: np.ndarray, rng: np.random.Generator) -> Surface:
    r, y = outer[int(0.35 * len(outer))]
    top, reach = outer[-1, 1], rng.uniform(0.3, 0.6)
    points = np.array(
        [[-r * 0.8, y, 0], [-r - 0.5 * reach, y + 0.25 * top, 0], [-r - reach, 0.95 * top, 0]]
    )
    return tube(curve(points, 40), np.linspace(0.18, 0.07, 40) * top, 24)


def _lid(outer: np.ndarray, rng: np.random.Generator) -> Surface:
    r, y = outer[-1]
    knob = rng.uniform(0.15, 0.3) * r
    points = [[1.06 * r, 0], [1.06 * r, 0.08 * r], [0.6 * r, 0.3 * r], [0.5 * knob, 0.4 * r]]
    points += [
        [knob, 0.4 * r + knob],
        [0.5 * knob, 0.4 * r + 1.8 * knob],
        [0, 0.4 * r + 1.9 * knob],
    ]
    profile = np.concatenate([[[0, 0]], curve(np.array(points), 50)])
    return placed(revolved(profile, 96), (0, y, 0))
