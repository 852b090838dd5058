"""Costs tabulated on a uniform grid: the negative log densities of the priors, read with linear
interpolation.

Between nodes the value is interpolated linearly and the derivative is the slope of the current
cell; beyond either end the end cell's slope goes on, so that a cost never goes flat where an
optimiser could get lost.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TabulatedPotential:
    """A cost of one number:

    `values[k]` is the cost at `low + k * step`; `values` is float64 of shape (nodes,).
    """

    low: float
    step: float
    values: np.ndarray

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cost and derivative at `x` (any shape), both float64 of x's shape."""
        position = (np.asarray(x, float) - self.low) / self.step
        cell = np.clip(np.floor(position), 0, len(self.values) - 2).astype(np.int64)
        below = self.values[cell]
        rise = self.values[cell + 1] - below
        return below + (position - cell) * rise, rise / self.step
