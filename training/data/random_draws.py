"""Random draws shared by the sample generators."""

import numpy as np


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number from [low, high] whose logarithm is uniform; `low` > 0."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
