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
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
