"""Nearly achromatic textures: white paper with pale print, porcelain, dark rubber, stone. This is
the hard case for separating highlights, because the albedo hardly differs in colour from white
light.

Equation: chroma = (largest - smallest channel) / largest channel, at most `LARGEST_CHROMA`
everywhere.
"""

import numpy as np

from .colours import colour
from .fields import fractal_noise, over, smooth_noise, step
from .prints import print_covers

LARGEST_CHROMA = 0.12


def texture(rng: np.random.Generator, size: int) -> np.ndarray:
    """Draw a nearly achromatic texture.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    size : int
        Side in texels.

    Returns
    -------
    (size, size, 3) ndarray
        Linear Rec.709.
    """
    return (_paper, _porcelain, _rubber, _stone)[rng.integers(4)](rng, size)


def _tint(rng: np.random.Generator, value: float) -> np.ndarray:
    """A grey with a trace of colour, (3,)."""
    return colour(rng.uniform(), rng.uniform(0, LARGEST_CHROMA), value)


def _mottled(
    rng: np.random.Generator, size: int, base: np.ndarray, amount: float, slope: float
) -> np.ndarray:
    """A colour (size, size, 3), varied in brightness by `amount` (relative standard deviation)."""
    return base * np.clip(1 + amount * fractal_noise(rng, size, slope), 0.2, 2)[..., None]


def _paper(rng: np.random.Generator, size: int) -> np.ndarray:
    """White paper or card with print in greys."""
    base = _mottled(rng, size, _tint(rng, rng.uniform(0.6, 0.8)), 0.015, 1)
    for cover in print_covers(rng, size):
        base = over(base, _tint(rng, rng.uniform(0.08, 0.5)), cover)
    return base


def _porcelain(rng: np.random.Generator, size: int) -> np.ndarray:
    """White glaze over a faint pattern of shades, half of the time with a pale drawing."""
    base = _mottled(rng, size, _tint(rng, rng.uniform(0.55, 0.85)), 0.03, 3)
    base = over(
        base,
        _tint(rng, rng.uniform(0.4, 0.6)),
        0.7 * step(smooth_noise(rng, size, rng.uniform(2, 5)) - 0.6, 0.5),
    )
    return (
        over(base, _tint(rng, rng.uniform(0.3, 0.5)), print_covers(rng, size)[0])
        if rng.random() < 0.5
        else base
    )


def _rubber(rng: np.random.Generator, size: int) -> np.ndarray:
    """Dark rubber or plastic, scuffed: paler where it is worn."""
    base = _mottled(rng, size, _tint(rng, rng.uniform(0.035, 0.1)), 0.08, 1.5)
    worn = step(
        smooth_noise(rng, size, rng.uniform(1.5, 4)) + 0.4 * fractal_noise(rng, size, 1.5) - 0.8,
        0.6,
    )
    return over(base, _tint(rng, rng.uniform(0.1, 0.2)), 0.6 * worn)


def _stone(rng: np.random.Generator, size: int) -> np.ndarray:
    """Granite or concrete: grains of two greys on a third."""
    base = _mottled(rng, size, _tint(rng, rng.uniform(0.2, 0.5)), 0.1, 1.5)
    for value in rng.uniform((0.05, 0.4), (0.2, 0.7)):
        grains = smooth_noise(rng, size, rng.uniform(15, 40))
        base = over(base, _tint(rng, value), 0.8 * step(grains - rng.uniform(0.6, 1.4), 0.3))
    return base
