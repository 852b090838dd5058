"""Colours of pigments, linear Rec.709.

Equation: value * (1 - purity + purity * k(hue)), k the fully saturated colour of the hue. Pigments
differ in their largest reflectance: yellow ones reflect up to .85, green and blue ones less than
half of it (rough figures, from the appearance of paints).

Limits: no spectra, no fluorescence.
"""

import numpy as np

# Largest channel of a saturated pigment, every twelfth of a turn from red over yellow, green, cyan,
# blue and magenta to red.
_LARGEST = (0.7, 0.8, 0.85, 0.55, 0.4, 0.4, 0.45, 0.45, 0.4, 0.4, 0.5, 0.6, 0.7)


def colour(hue: float, purity: float, value: float) -> np.ndarray:
    """Return a colour.

    Parameters
    ----------
    hue : float
        In turns: 0 red, 1/3 green.
    purity : float
        In [0, 1].
    value : float
        The largest channel.

    Returns
    -------
    (3,) ndarray
        Linear Rec.709.
    """
    place = np.mod(hue + np.array([0, 2 / 3, 1 / 3]), 1) * 6
    full = np.clip(np.abs(place - 3) - 1, 0, 1)
    return value * (1 - purity + purity * full)


def pigment(rng: np.random.Generator, hue: float | None = None) -> np.ndarray:
    """Draw a saturated colour.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    hue : float, optional
        In turns; random by default.

    Returns
    -------
    (3,) ndarray
        Linear Rec.709.
    """
    hue = rng.uniform() if hue is None else hue
    return colour(hue, rng.uniform(0.7, 0.97), rng.uniform(0.3, 1) * _brightest(hue))


def pale(rng: np.random.Generator) -> np.ndarray:
    """Draw a pastel colour.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (3,) ndarray
        Linear Rec.709.
    """
    return colour(rng.uniform(), rng.uniform(0.06, 0.4), rng.uniform(0.5, 0.85))


def dark(rng: np.random.Generator) -> np.ndarray:
    """Draw a colour near black: ink, dark glaze.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (3,) ndarray
        Linear Rec.709.
    """
    return colour(rng.uniform(), rng.uniform(0.1, 0.8), rng.uniform(0.03, 0.12))


def paper(rng: np.random.Generator) -> np.ndarray:
    """Draw a white to cream colour.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (3,) ndarray
        Linear Rec.709.
    """
    return rng.uniform(0.6, 0.85) * np.array([1, rng.uniform(0.93, 1), rng.uniform(0.78, 1)])


def ink(rng: np.random.Generator) -> np.ndarray:
    """Draw black, or a saturated colour dark enough to be read on paper.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (3,) ndarray
        Linear Rec.709.
    """
    if rng.random() < 0.4:
        return np.full(3, rng.uniform(0.02, 0.05))
    hue = rng.uniform()
    return colour(hue, rng.uniform(0.8, 0.97), rng.uniform(0.15, 0.6) * _brightest(hue))


def palette(rng: np.random.Generator, count: int) -> np.ndarray:
    """Draw colours with well-spread hues, sometimes including a white or dark one.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    count : int
        Number of colours.

    Returns
    -------
    (count, 3) ndarray
        Linear Rec.709.
    """
    hues = rng.uniform() + (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count
    colours = np.stack([pigment(rng, hue) for hue in hues])
    chance = rng.random()
    if chance < 0.35:
        colours[0] = paper(rng)
    elif chance < 0.5:
        colours[0] = dark(rng)
    return rng.permutation(colours)


def _brightest(hue: float) -> float:
    return float(np.interp(hue % 1, np.linspace(0, 1, len(_LARGEST)), _LARGEST))
