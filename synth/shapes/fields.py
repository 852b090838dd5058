"""Smooth random functions of place, for bumps, folds and reliefs.

Equation: f(p) = sqrt(2 / n) sum_i cos(2 pi k_i . p + phase_i), directions of k and phases uniform,
lengths of k log-normal.

Citation: M. Shinozuka and G. Deodatis, "Simulation of stochastic processes by spectral
representation", Applied Mechanics Reviews 44 (1991), doi:10.1115/1.3119501.

Limits: mean 0 and variance 1 over all draws, not for each; nearly normal for n of 10 and more.
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
    """A random function at `points` (..., D):

    (...). `frequency`: cycles a unit of length, its median; `spread`: of its logarithm.
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
    # float32 halves the time; 1e-6 of a bump is nothing.
    return np.cos((points @ across + phase).astype(np.float32)).sum(-1, dtype=float) * np.sqrt(
        2 / waves
    )


def ridged(values: np.ndarray, sharpness: float) -> np.ndarray:
    """Creases where a smooth function crosses 0: -|f|, rounded within 1 / sharpness."""
    return -np.hypot(values, 1 / sharpness)
