"""Costs tabulated on a uniform grid: the negative log densities of the priors.

Between nodes the cost is interpolated linearly, and the derivative is the slope of the cell. Beyond
either end the slope of the end cell continues, so that the gradient does not vanish there.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class TabulatedPotential:
    """A cost of one number.

    Attributes
    ----------
    low, step : float
        Argument at the first node, and spacing of the nodes.
    values : (nodes,) float64 ndarray
        Cost at `low + k * step`.
    """

    low: float
    step: float
    values: np.ndarray

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the cost and its derivative.

        Parameters
        ----------
        x : ndarray

        Returns
        -------
        tuple of float64 ndarray
            Cost and derivative, each of the shape of `x`.
        """
        position = (np.asarray(x, float) - self.low) / self.step
        cell = np.clip(np.floor(position), 0, len(self.values) - 2).astype(np.int64)
        below = self.values[cell]
        rise = self.values[cell + 1] - below
        return below + (position - cell) * rise, rise / self.step
