# mypy: disable-error-code="no-untyped-def"
"""Edge-aware averages, in a time independent of their extent.

Problem: a statistic over the pixels that can be reached from a pixel without crossing an edge.

Equation: along a row (then a column) the recursive filter y_j = x_j + a^d_j (y_(j-1) - x_j),
forward and backward, with a = exp(-sqrt 2 / sigma) and d_j the distance to the neighbour: one pixel
plus what an edge adds. Passes over rows and columns alternate, the later ones with smaller sigma.

The lower mode is the value that most pixels agree on when higher ones count less: the fixed point
of a weighted average whose weight is 1 below it and falls as exp(-(t - mode) / tau) above.
Highlights, which only ever raise t, hardly move it.

Citation: E. S. L. Gastal and M. M. Oliveira, "Domain transform for edge-aware image and video
processing", ACM Trans. Graph. 30(4), 69 (2011), doi:10.1145/2010324.1964964.
"""

from dataclasses import dataclass

import numpy as np

from ...numerics.jit import compiled_available, jit

_PASSES = 2


@dataclass(frozen=True, eq=False)
class Paths:
    """Distances between neighbouring pixels.

    Attributes
    ----------
    across, down : (H, W) ndarray
        To the left and the upper neighbour, at least 1.
    reach : float
        sigma, in the same unit.
    """

    across: np.ndarray
    down: np.ndarray
    reach: float

    def average(self, layers: np.ndarray) -> np.ndarray:
        """Smooth layers along the paths.

        Parameters
        ----------
        layers : (n, H, W) ndarray

        Returns
        -------
        (n, H, W) ndarray
        """
        smooth = np.ascontiguousarray(layers.transpose(2, 0, 1))  # the filtered axis comes first
        for step in range(_PASSES):
            sigma = self.reach * np.sqrt(3) * 2 ** (_PASSES - 1 - step) / np.sqrt(4**_PASSES - 1)
            log_feedback = -np.sqrt(2) / sigma
            across = np.ascontiguousarray(self.across.T)
            _filter_recursively(smooth, np.exp(log_feedback * across))
            smooth = np.ascontiguousarray(smooth.transpose(2, 1, 0))
            _filter_recursively(smooth, np.exp(log_feedback * self.down))
            smooth = np.ascontiguousarray(smooth.transpose(2, 1, 0))
        return smooth.transpose(1, 2, 0)

    def weighted(self, value: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Return the weighted average along the paths.

        Parameters
        ----------
        value : (H, W) ndarray
        weight : (H, W) ndarray
            Not negative.

        Returns
        -------
        (H, W) ndarray
        """
        total, weights = self.average(np.stack([weight * value, weight]))
        return total / np.maximum(weights, 1e-12)

    def lower_mode(
        self, value: np.ndarray, weight: np.ndarray, tau: float, rounds: int
    ) -> np.ndarray:
        """Return the lower mode of a map.

        Parameters
        ----------
        value, weight : (H, W) ndarray
        tau : float
            In the unit of `value`.
        rounds : int
            Of re-weighting.

        Returns
        -------
        (H, W) ndarray
        """
        mode = self.weighted(value, weight)
        for _ in range(rounds):
            mode = self.weighted(value, weight * np.exp(-np.maximum(value - mode, 0) / tau))
        return mode


def _filter_recursively(layers: np.ndarray, feedback: np.ndarray) -> None:
    """One pass forward and back over the first axis of `layers` (W, n, H), in place.

    `feedback` (W, H): of the step into each pixel.
    """
    if compiled_available():
        _filter_rows(layers, feedback.astype(layers.dtype, copy=False))
        return
    last = len(layers)
    for j in range(1, last):
        layers[j] += feedback[j] * (layers[j - 1] - layers[j])
    for j in range(last - 2, -1, -1):
        layers[j] += feedback[j + 1] * (layers[j + 1] - layers[j])


@jit(types="r[3] r[2]")
def _filter_rows(layers, feedback):
    """As `_filter_recursively`."""
    last, count, length = layers.shape
    for j in range(1, last):
        for k in range(count):
            here, before, share = layers[j, k], layers[j - 1, k], feedback[j]
            for i in range(length):
                here[i] += share[i] * (before[i] - here[i])
    for j in range(last - 2, -1, -1):
        for k in range(count):
            here, before, share = layers[j, k], layers[j + 1, k], feedback[j + 1]
            for i in range(length):
                here[i] += share[i] * (before[i] - here[i])
