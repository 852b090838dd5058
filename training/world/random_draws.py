"""Random draws shared by the sample generators."""

import numpy as np


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform.

    Parameters
    ----------
    rng : np.random.Generator
    low, high : float
        Bounds; 0 < `low` <= `high`.

    Returns
    -------
    float
        In [low, high].
    """
    return float(log_uniforms(rng, low, high, ()))


def log_uniforms(
    rng: np.random.Generator, low: float, high: float, size: int | tuple[int, ...]
) -> np.ndarray:
    """Draw numbers whose logarithms are uniform.

    Parameters
    ----------
    rng : np.random.Generator
    low, high : float
        Bounds; 0 < `low` <= `high`.
    size : int or tuple of int

    Returns
    -------
    ndarray
        In [low, high].
    """
    return np.asarray(np.exp(rng.uniform(np.log(low), np.log(high), size)))
