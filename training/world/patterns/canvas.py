"""What painters of patterns share: places, sharp edges, and noise that tiles.

Equation: noise is white noise whose spectrum is multiplied by f^(-b/2); a discrete Fourier
transform is periodic, and so are the maps. Sharp edges are drawn three times as fine and averaged.

Citation: R. F. Voss (1988), "Fractals in nature: from characterization to simulation",
doi:10.1007/978-1-4612-3784-6_1 (filtered noise).
"""

from typing import NamedTuple

import numpy as np

FINER = 3


class Painting(NamedTuple):
    """A map (side, side) of values from 0 to 1, and whether opposite edges fit."""

    values: np.ndarray
    tileable: bool


def places(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixel centres of a map.

    Parameters
    ----------
    side : int

    Returns
    -------
    x, y : (side, side) ndarray
        From 0 to 1, x along the columns.
    """
    line = (np.arange(side) + 0.5) / side
    x, y = np.meshgrid(line, line)
    return x, y


def averaged(fine: np.ndarray) -> np.ndarray:
    """Average blocks of `FINER` pixels a side.

    Parameters
    ----------
    fine : (FINER side, FINER side) ndarray

    Returns
    -------
    (side, side) ndarray
    """
    side = len(fine) // FINER
    return np.asarray(fine.reshape(side, FINER, side, FINER).mean((1, 3)))


def stretched(values: np.ndarray) -> np.ndarray:
    """Map values linearly to 0 to 1.

    Parameters
    ----------
    values : ndarray

    Returns
    -------
    ndarray
    """
    low, high = values.min(), values.max()
    return np.asarray((values - low) / max(high - low, 1e-12))


def filtered_noise(
    rng: np.random.Generator,
    side: int,
    power: float,
    least: float = 1,
    stretch: tuple[float, float] = (1, 1),
) -> np.ndarray:
    """Draw noise that tiles.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int
    power : float
        b of the spectrum f^-b: 0 is white, 2 rugged, 4 cloudy.
    least : float
        Lowest frequency, in waves a side.
    stretch : tuple of float
        How many times longer features are along x and along y.

    Returns
    -------
    (side, side) ndarray
        Of mean 0 and deviation 1.
    """
    fy = np.fft.fftfreq(side, 1 / side)[:, None] * stretch[1]
    fx = np.fft.rfftfreq(side, 1 / side)[None] * stretch[0]
    frequency = np.hypot(fx, fy)
    gain = np.where(frequency >= least, np.maximum(frequency, least) ** (-power / 2), 0)
    values = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((side, side))) * gain, (side, side))
    return np.asarray(values / max(float(values.std()), 1e-12))


def wave_vector(rng: np.random.Generator, low: float, high: float) -> tuple[int, int]:
    """Draw a direction and a number of whole waves a side, so that the pattern tiles.

    Parameters
    ----------
    rng : numpy.random.Generator
    low, high : float
        Waves a side.

    Returns
    -------
    x, y : int
        Not both 0.
    """
    length = np.exp(rng.uniform(np.log(low), np.log(high)))
    angle = rng.choice([0, np.pi / 2, rng.uniform(0, np.pi)])
    x, y = round(length * np.cos(angle)), round(length * np.sin(angle))
    return (x, y) if x or y else (1, 0)
