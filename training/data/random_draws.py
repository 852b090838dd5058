"""What random scenes and pictures are drawn with."""

import numpy as np


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """From `low` to `high` > 0, its logarithm evenly."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
