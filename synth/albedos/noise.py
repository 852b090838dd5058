"""Colours that vary everywhere: clouds of colour, marble, wood, speckled glaze, running glazes.

Equation: marble's veins are the zeros of a fractal field, wood's rings the level lines of a nearly
flat one: Perlin's turbulence.

Citation: K. Perlin, "An image synthesizer", SIGGRAPH 1985, 287-296, doi:10.1145/325334.325247.
"""

import numpy as np

from .colours import colour, dark, pale, palette, paper, pigment
from .fields import fractal_noise, grid, over, smooth_noise, softened, step


def texture(rng: np.random.Generator, size: int) -> np.ndarray:
    """Draw a texture of clouds, marble, wood, speckles or running glazes.

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
    return (_clouds, _marble, _wood, _speckles, _running_glaze)[rng.integers(5)](rng, size)


def _clouds(rng: np.random.Generator, size: int) -> np.ndarray:
    """Two or three colours mixed in shares that vary at all scales."""
    colours = palette(rng, int(rng.integers(2, 4)))
    slope, sharpness = rng.uniform(1.5, 3), rng.uniform(1, 2.5)
    weights = np.stack(
        [np.exp(sharpness * fractal_noise(rng, size, slope)) for _ in colours], axis=-1
    )
    return weights / weights.sum(-1, keepdims=True) @ colours


def _marble(rng: np.random.Generator, size: int) -> np.ndarray:
    """A pale or dark stone with clouds and veins of two widths."""
    stone, vein = (paper(rng), dark(rng)) if rng.random() < 0.7 else (dark(rng), paper(rng))
    if rng.random() < 0.4:
        stone, vein = pigment(rng) * 0.7, paper(rng)
    result = over(
        np.broadcast_to(stone, (size, size, 3)),
        0.5 * (stone + vein),
        0.25 + 0.2 * fractal_noise(rng, size, 2.5),
    )
    for cycles, width, strength in ((1.5, 0.05, 0.8), (4, 0.06, 0.45)):
        field = smooth_noise(rng, size, cycles) + 0.35 * fractal_noise(rng, size, 1.8)
        fade = step(smooth_noise(rng, size, 2) + 0.3, 1)
        result = over(result, vein, strength * fade * np.exp(-np.abs(field) / width))
    return result


def _wood(rng: np.random.Generator, size: int) -> np.ndarray:
    """Rings cut along the trunk, which runs around; fibres finer than the rings."""
    late = colour(rng.uniform(0.03, 0.08), rng.uniform(0.7, 0.9), rng.uniform(0.08, 0.3))
    early = np.minimum(late * rng.uniform(1.8, 3) + 0.05, 0.8)
    _, v = grid(size)
    rings = rng.uniform(5, 12) * v + 0.8 * smooth_noise(rng, size, 2.5, 4)
    phase = np.mod(rings, 1)
    share = np.where(phase < 0.85, phase / 0.85, (1 - phase) / 0.15) ** 1.5
    fibres = fractal_noise(rng, size, 1.0, 25)
    return over(
        np.broadcast_to(early, (size, size, 3)), late, softened(share) * 0.8 + 0.08 * fibres
    )


def _speckles(rng: np.random.Generator, size: int) -> np.ndarray:
    """Stoneware or enamel: specks of one or two colours on a slightly cloudy ground."""
    ground = pale(rng) if rng.random() < 0.6 else pigment(rng)
    result = ground * (1 + 0.05 * fractal_noise(rng, size, 2))[..., None]
    for _ in range(int(rng.integers(1, 3))):
        field = smooth_noise(rng, size, rng.uniform(15, 45))
        result = over(
            result,
            dark(rng) if rng.random() < 0.6 else paper(rng),
            step(field - rng.uniform(1.2, 2), 0.25),
        )
    return result


def _running_glaze(rng: np.random.Generator, size: int) -> np.ndarray:
    """Two or three glazes that run into each other from top to bottom."""
    glazes = palette(rng, int(rng.integers(2, 4)))
    _, v = grid(size)
    result = np.broadcast_to(glazes[0], (size, size, 3))
    for number, glaze in enumerate(glazes[1:], 1):
        run = (
            v
            - number / len(glazes)
            + 0.06 * smooth_noise(rng, size, 3)
            + 0.03 * fractal_noise(rng, size, 2, 0.2)
        )
        result = over(result, glaze, step(run, rng.uniform(0.02, 0.15)))
    return result * (1 + 0.05 * fractal_noise(rng, size, 2))[..., None]
