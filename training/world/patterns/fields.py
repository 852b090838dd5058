"""Soft patterns: noise, marble, the skin of fruit, gradients.

Citation: K. Perlin (1985), "An image synthesizer", doi:10.1145/325165.325247 (marble as a
disturbed wave).
"""

import numpy as np
from scipy.ndimage import gaussian_filter

from .canvas import FINER, Painting, averaged, filtered_noise, places, stretched, wave_vector


def noise(rng: np.random.Generator, side: int) -> Painting:
    """Draw fractal noise of any ruggedness; some of it ridged, some cut at a level.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    power, least = rng.uniform(1.5, 4.5), np.exp(rng.uniform(0, np.log(10)))
    stretch = (1.0, 1.0) if rng.random() < 0.7 else (rng.uniform(1, 8), 1.0)
    style = rng.random()
    if style < 0.2:  # sharp islands, like camouflage or rust
        values = filtered_noise(rng, FINER * side, rng.uniform(2.5, 4), min(least, 6.0))
        return Painting(averaged((values > rng.normal(0, 0.5)) * 1.0), True)
    values = filtered_noise(rng, side, power, least, stretch)
    if style < 0.4:
        values = -(np.abs(values) ** rng.uniform(0.5, 1))
    return Painting(_contrast(rng, values), True)


def marble(rng: np.random.Generator, side: int) -> Painting:
    """Draw veins: a wave or a ridge, disturbed by noise.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    turbulence = filtered_noise(rng, side, rng.uniform(3.4, 4.6))
    if rng.random() < 0.5:
        p, q = wave_vector(rng, 1, 4)
        x, y = places(side)
        wave = np.sin(2 * np.pi * (p * x + q * y) + rng.uniform(1, 4) * turbulence)
    else:
        wave = turbulence
    veins = np.exp(-np.abs(wave) * rng.uniform(2, 12))
    finer = np.exp(-np.abs(filtered_noise(rng, side, 4, 3)) * 15) * rng.uniform(0, 0.6)
    cloud = filtered_noise(rng, side, 3.5) * rng.uniform(0, 0.2)
    return Painting(stretched(np.maximum(veins, finer) + cloud), True)


def blotches(rng: np.random.Generator, side: int) -> Painting:
    """Draw the skin of a fruit, an egg or a stone: a soft ground, blotches and speckles.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    fine = FINER * side
    ground = stretched(filtered_noise(rng, fine, 4)) * rng.uniform(0, 0.7)
    if rng.random() < 0.4:  # streaks from end to end, as on an apple
        streaks = filtered_noise(rng, fine, 2, 4, (1, rng.uniform(6, 20)))
        ground = ground + rng.uniform(0.1, 0.3) * streaks
    for _ in range(int(rng.integers(1, 4))):
        size = np.exp(rng.uniform(np.log(2), np.log(20))) * fine / 384
        spots = gaussian_filter(rng.standard_normal((fine, fine)), size, mode="wrap")
        spots = spots / spots.std() - rng.uniform(1.2, 2.8)
        ground = ground + rng.choice([-1, 1]) * rng.uniform(0.3, 1) * np.clip(
            spots * rng.uniform(0.6, 6), 0, 1
        )
    return Painting(stretched(averaged(ground)), True)


def gradient(rng: np.random.Generator, side: int) -> Painting:
    """Draw a linear, radial or angular gradient, between corners, or in steps.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    x, y = (place - 0.5 for place in places(FINER * side))
    angle, style = rng.uniform(0, 2 * np.pi), rng.random()
    values = x * np.cos(angle) + y * np.sin(angle)
    if style < 0.3:
        middle = rng.uniform(-0.4, 0.4, 2)
        values = np.hypot(x - middle[0], (y - middle[1]) * rng.uniform(0.5, 2))
    elif style < 0.4:
        values = np.abs((np.arctan2(y, x) - angle) % (2 * np.pi) - np.pi)
    elif style < 0.6:
        a, b, c = rng.normal(size=3)
        values = a * x + b * y + 4 * c * x * y
    values = stretched(values) ** np.exp(rng.normal(0, 0.4))
    if rng.random() < 0.3:
        steps = int(rng.integers(2, 8))
        values = np.floor(values * steps * 0.999) / (steps - 1)
    elif rng.random() < 0.3:  # a soft edge anywhere
        values = 1 / (1 + np.exp(-(values - rng.uniform(0.3, 0.7)) * rng.uniform(8, 80)))
    return Painting(averaged(values), False)


def _contrast(rng: np.random.Generator, values: np.ndarray) -> np.ndarray:
    """Values from 0 to 1; the stronger the contrast, the more of them clip."""
    low, high = np.percentile(values, (0, 100) if rng.random() < 0.5 else (10, 90))
    return np.clip((values - low) / max(float(high - low), 1e-12), 0, 1)
