"""Colours that paints have, linear Rec.709.

Equation: value * (1 - purity + purity * k(hue)), k the fully saturated colour of the hue. Pigments
differ in how bright they can be: yellow ones reflect up to .85, green and blue ones less than half
of it (rough figures, from what paints look like).

Limits: no spectra, no fluorescence.
"""

import numpy as np

# The largest channel that a saturated pigment has, every twelfth of a turn from red over yellow,
# green, cyan, blue and magenta to red.
_LARGEST = (0.7, 0.8, 0.85, 0.55, 0.4, 0.4, 0.45, 0.45, 0.4, 0.4, 0.5, 0.6, 0.7)


def colour(hue: float, purity: float, value: float) -> np.ndarray:
    """(3,):

    `hue` in turns (0 red, 1/3 green), `purity` in [0, 1], `value` = the largest channel.
    """
    place = np.mod(hue + np.array([0, 2 / 3, 1 / 3]), 1) * 6
    full = np.clip(np.abs(place - 3) - 1, 0, 1)
    return value * (1 - purity + purity * full)


def pigment(rng: np.random.Generator, hue: float | None = None) -> np.ndarray:
    """A saturated paint; a random hue unless one is given (in turns)."""
    hue = rng.uniform() if hue is None else hue
    return colour(hue, rng.uniform(0.7, 0.97), rng.uniform(0.3, 1) * _brightest(hue))


def pale(rng: np.random.Generator) -> np.ndarray:
    """A pastel."""
    return colour(rng.uniform(), rng.uniform(0.06, 0.4), rng.uniform(0.5, 0.85))


def dark(rng: np.random.Generator) -> np.ndarray:
    """A colour near black: ink, dark glaze."""
    return colour(rng.uniform(), rng.uniform(0.1, 0.8), rng.uniform(0.03, 0.12))


def paper(rng: np.random.Generator) -> np.ndarray:
    """White to cream."""
    return rng.uniform(0.6, 0.85) * np.array([1, rng.uniform(0.93, 1), rng.uniform(0.78, 1)])


def ink(rng: np.random.Generator) -> np.ndarray:
    """Black, or a saturated colour dark enough to be read on paper."""
    if rng.random() < 0.4:
        return np.full(3, rng.uniform(0.02, 0.05))
    hue = rng.uniform()
    return colour(hue, rng.uniform(0.8, 0.97), rng.uniform(0.15, 0.6) * _brightest(hue))


def palette(rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 3) paints that go well apart: hues spread around the circle, now and then a white or
    a dark one among them.
    """
    hues = rng.uniform() + (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count
    paints = np.stack([pigment(rng, hue) for hue in hues])
    chance = rng.random()
    if chance < 0.35:
        paints[0] = paper(rng)
    elif chance < 0.5:
        paints[0] = dark(rng)
    return rng.permutation(paints)


def _brightest(hue: float) -> float:
    return float(np.interp(hue % 1, np.linspace(0, 1, len(_LARGEST)), _LARGEST))
