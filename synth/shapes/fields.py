"""Smooth random functions of position, for bumps, folds and reliefs.

Equation: f(p) = sqrt(2 / n) sum_i cos(2 pi k_i . p + phase_i), directions of k and phases uniform,
lengths of k log-normal.

Citation: M. Shinozuka and G. Deodatis, "Simulation of stochastic processes by spectral
representation", Applied Mechanics Reviews 44 (1991), doi:10.1115/1.3119501.

Limits: mean 0 and variance 1 over all draws, not for each; nearly normal for n >= 10.
"""

import numpy as np


def smooth_field(
    points: np.ndarray,
    rng: np.random.Generator,
    frequency: float,
    *,
    waves: int = 14,
    spread: float = 0.25,
) -> np.ndarray:
    """Evaluate a random function.

    Parameters
    ----------
    points : (..., D) ndarray
        Positions.
    rng : numpy.random.Generator
        Random numbers that define the function.
    frequency : float
        Median frequency, cycles per unit of length.
    waves : int, optional
        Number of cosines.
    spread : float, optional
        Standard deviation of the logarithm of the frequency.

    Returns
    -------
    (...) ndarray
        The values.
    """
    across = rng.normal(size=(points.shape[-1], waves))
    across *= (
        2
        * np.pi
        * frequency
        * np.exp(spread * rng.normal(size=waves))
        / np.linalg.norm(across, axis=0)
    )
    phase = rng.uniform(0, 2 * np.pi, waves)
    # float32 halves the time; its error of 1e-6 is far below any bump.
    return np.cos((points @ across + phase).astype(np.float32)).sum(-1, dtype=float) * np.sqrt(
        2 / waves
    )


def ridged(values: np.ndarray, sharpness: float) -> np.ndarray:
    """Turn the zeros of a smooth function into creases.

    Parameters
    ----------
    values : ndarray
        The function f.
    sharpness : float
        The creases are rounded within 1 / sharpness.

    Returns
    -------
    ndarray
        About -|f|.
    """
    return -np.hypot(values, 1 / sharpness)
