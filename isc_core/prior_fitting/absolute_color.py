"""The prior of absolute reflectance: a smooth density over whitened log colour, fitted to a
histogram.

Equation: minimise over tables f   sum p f + log sum exp(-f) + (c / nodes) sum sqrt(|second
derivatives of f|^2 + 1e-5), the negative log likelihood of the histogram p and a robust thin-plate
energy. The problem is convex; f is written as the sum of the levels of a pyramid whose finest level
is 0 (see `absolute_table`), so that L-BFGS updates features of all sizes at once.

Citation: J. T. Barron, J. Malik (2015), "Shape, illumination, and reflectance from shading",
doi:10.1109/TPAMI.2014.2377712; D. C. Liu, J. Nocedal 1989, doi:10.1007/BF01589116 (L-BFGS).

Limits: where there are no data, the table is extrapolated linearly to the border of its range.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..numerics.ellpack import Ellpack
from ..numerics.lbfgs import LbfgsOptions, NumpyAlgebra, minimise
from ..sirfs.priors.absolute_table import CoarseTable, synthesis_matrix, synthesise
from .roughness import roughness

COLOR_NODES = 102
GREY_NODES = 256


def _ignore(loss: float) -> None:
    del loss


@dataclass(frozen=True)
class TableFitOptions:
    """Options of the fit of a table.

    Attributes
    ----------
    smoothness : float
        The constant c.
    levels : int
        Levels of the pyramid, the fixed finest one included.
    memory : int
        Pairs stored by L-BFGS.
    tolerance : float
        Stop when the last five losses are within this relative distance of the current one.
    runs : int
        Number of runs, each starting from the previous result with an empty memory.
    max_steps : int
        Maximum number of steps of each run.
    """

    smoothness: float = 512.0
    levels: int = 6
    memory: int = 10
    tolerance: float = 1e-5
    runs: int = 2
    max_steps: int = 1000


def fit_absolute_table(
    histogram: np.ndarray, options: TableFitOptions, on_step: Callable[[float], None] = _ignore
) -> CoarseTable:
    """Fit a table to a histogram.

    Parameters
    ----------
    histogram : (n, ...) ndarray
        p, with one or three axes of equal length, sum 1.
    options : TableFitOptions
    on_step : callable, optional
        Receives the loss after every step, and may raise to stop.

    Returns
    -------
    CoarseTable
        In half precision if there are three axes.
    """
    problem = _Problem(histogram, options)
    unknowns = np.zeros(problem.size, np.float32)
    search = LbfgsOptions(
        options.memory,
        options.max_steps,
        4 * options.max_steps,
        options.tolerance,
        gradient_tolerance=0.0,
    )
    for _ in range(options.runs):
        minimise(problem.loss, unknowns, search, NumpyAlgebra(), lambda _, loss: on_step(loss))
    return CoarseTable.of(
        problem.coarse(unknowns),
        histogram.shape[0],
        np.float16 if histogram.ndim > 1 else np.float32,
    )


class _Problem:
    """The loss as a function of all free levels of the pyramid in one vector."""

    def __init__(self, histogram: np.ndarray, options: TableFitOptions) -> None:
        self.histogram = histogram.astype(np.float32)
        self.weight = options.smoothness / histogram.size
        self.matrices: list[Ellpack] = []
        self.shapes: list[tuple[int, ...]] = []
        nodes = histogram.shape[0]
        for _ in range(options.levels - 1):
            self.matrices.append(synthesis_matrix(nodes, np.float32))
            nodes = -(-nodes // 2)
            self.shapes.append((nodes,) * histogram.ndim)
        self.transposed = [one.transposed for one in self.matrices]
        self.ends = np.cumsum([int(np.prod(shape)) for shape in self.shapes])
        self.size = int(self.ends[-1])

    def coarse(self, unknowns: np.ndarray) -> np.ndarray:
        """The sum of the second finest and all coarser levels, whose upsampling is the table."""
        parts = np.split(unknowns, self.ends[:-1])
        levels = [part.reshape(shape) for part, shape in zip(parts, self.shapes, strict=True)]
        total = levels[-1]
        for level, matrix in zip(levels[-2::-1], self.matrices[:0:-1], strict=True):
            total = level + synthesise(matrix, total)
        return total

    def loss(self, unknowns: np.ndarray, gradient: np.ndarray) -> float:
        """Return the loss, and write its gradient; arrays are float32, sums float64."""
        f = synthesise(self.matrices[0], self.coarse(unknowns))
        value, slope = _negative_log_likelihood(f, self.histogram)
        bending, bending_slope = roughness(f)
        bending_slope *= np.float32(self.weight)
        slope += bending_slope
        for transposed, part in zip(
            self.transposed, np.split(gradient, self.ends[:-1]), strict=True
        ):
            slope = synthesise(transposed, slope)
            part[:] = slope.ravel()
        return value + self.weight * bending


def _negative_log_likelihood(f: np.ndarray, histogram: np.ndarray) -> tuple[float, np.ndarray]:
    lowest = f.min()
    density = np.exp(lowest - f)
    partition = density.sum(dtype=float)
    density *= np.float32(-1 / partition)
    density += histogram
    value = (
        np.einsum("i,i->", histogram.ravel(), f.ravel(), dtype=float) + np.log(partition) - lowest
    )
    return float(value), density
