"""Shape and illumination from one image: the minimiser of the SIRFS objective.

Problem: one L-BFGS run optimises the levels of the height's pyramid and the whitened light jointly.
Reflectance is not an unknown: log A = log I - log shading reproduces the image exactly. The solver
starts at `settings.Start`; of several starts, the one with the lowest loss after a number of
evaluations is continued.

Citation: J. T. Barron, J. Malik, "Shape, Illumination, and Reflectance from Shading", TPAMI 37(8),
2015, doi:10.1109/TPAMI.2014.2377712.

Limits: the objective has many minima; this finds one of them. Coarse-to-fine solving finds others,
as often worse as better, and saved no time.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..errors import InputError
from ..numerics.jit import compiled_available
from ..numerics.lbfgs import Algebra, LbfgsOptions, LbfgsResult, Minimisation, NumpyAlgebra
from ..numerics.linear import solve_linear
from ..numerics.thread_pool import ThreadPool
from ..progress import Monitor
from .illumination import stack, unstack
from .normal_prior import predicted_height
from .problem import Evaluation, Problem, Terms
from .pyramid import analyse, down, level_shapes, synthesise
from .settings import Start

STAGE = "shape and light"
MAX_THREADS = 64  # more do not make a solve faster
# Level of the pyramid: finer detail of the dome follows the silhouette, not the shape.
_START_LEVEL = 2
_PREDICTED_LEVEL = 1  # about as fine as the network that predicts the normals
# Evaluations per start, out of the hundreds of a solve: by then, the losses of good and bad minima
# differ.
_TRIAL = 80
# `down` multiplies heights by 8, and upsampling by one level doubles them.
_COARSER = 16
# Magnitudes beyond which a trial is not evaluated: their curvature or reflectance would be NaN in
# float32, and the kernels look these up in tables.
_MOST_HEIGHT, _MOST_LIGHT = 1e11, 1e6


@dataclass(frozen=True)
class SolverOptions:
    """Options of the solver; they do not change the objective.

    Attributes
    ----------
    engine : str
        "numba", "numpy", or "auto" for compiled kernels if Numba is installed.
    single : bool
        float32 unknowns (production) or float64.
    threads : int
        Number of threads; 0 for all cores.
    levels : int or None
        Levels of the height's pyramid; None for all, see `pyramid.level_shapes`.
    lbfgs : LbfgsOptions
        Options of the optimiser. It stops at twice the published tolerance: further evaluations
        lower the loss, but do not improve the accuracy.
    """

    engine: str = "auto"
    single: bool = True
    threads: int = 0
    levels: int | None = None
    lbfgs: LbfgsOptions = field(default_factory=lambda: LbfgsOptions(loss_tolerance=1e-4))


@dataclass(frozen=True, eq=False)
class SirfsResult:
    """Solution of a problem.

    Attributes
    ----------
    height : (H, W) float64 ndarray
        Pixels toward the viewer.
    light : (9, C) float64 ndarray
        Log-shading SH coefficients, reference convention.
    terms : Terms
        Terms of the objective there.
    iterations, evaluations : int
        Steps of the optimiser, and evaluations of the objective.
    reason : str
        Why the optimiser stopped, see `LbfgsResult`.
    converged : bool
        Whether it stopped because the loss no longer decreased.
    """

    height: np.ndarray
    light: np.ndarray
    terms: Terms
    iterations: int
    evaluations: int
    reason: str
    converged: bool


class Engine(Protocol):
    """Evaluates the objective."""

    def evaluate(self, height: np.ndarray, light: np.ndarray) -> Evaluation:
        """Compute the objective and its gradients.

        Parameters
        ----------
        height : (H, W) ndarray
            Pixels toward the viewer.
        light : (9, C) ndarray
            Log-shading SH coefficients.

        Returns
        -------
        Evaluation
        """
        ...


def thread_count(options: SolverOptions) -> int:
    """Return the number of threads of a solve.

    Parameters
    ----------
    options : SolverOptions

    Returns
    -------
    int
        At most `MAX_THREADS`; for 0 threads, the number of cores that this process may use.
    """
    allowed = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    return min(options.threads or allowed, MAX_THREADS)


class Backend:
    """The engine and its algebra, chosen once for a solve.

    Parameters
    ----------
    options : SolverOptions
    workers : ThreadPool

    Raises
    ------
    InputError
        If the engine is unknown, or Numba is required but not installed.
    """

    def __init__(self, options: SolverOptions, workers: ThreadPool) -> None:
        if options.engine not in ("auto", "numba", "numpy"):
            raise InputError(f'unknown engine "{options.engine}": choose auto, numba or numpy')
        self.compiled = options.engine != "numpy" and compiled_available()
        if options.engine == "numba" and not self.compiled:
            raise InputError(
                "the engine numba needs the package numba: install it, or choose --engine numpy"
            )
        self.dtype: type[np.floating] = np.float32 if options.single else np.float64
        self._workers = workers

    def engine(self, problem: Problem) -> Engine:
        """Return the engine for a problem.

        Parameters
        ----------
        problem : Problem

        Returns
        -------
        Engine
        """
        if not self.compiled:
            from .numpy_engine import NumpyEngine

            return NumpyEngine(problem, self.dtype)
        from .numba_engine import NumbaEngine

        return NumbaEngine(problem, self.dtype, self._workers)

    def algebra(self) -> Algebra:
        """Return the algebra for L-BFGS."""
        if not self.compiled:
            return NumpyAlgebra()
        from .vector_kernels import CompiledAlgebra

        return CompiledAlgebra(self._workers)

    def synthesise(self, levels: list[np.ndarray]) -> np.ndarray:
        """Return the height in float64, regardless of the type of the levels.

        A rounded coarse level still gives a smooth height.

        Parameters
        ----------
        levels : list of ndarray
            Finest first.

        Returns
        -------
        (H, W) float64 ndarray
        """
        height = levels[-1].astype(float)
        if not self.compiled:
            return synthesise([*levels[:-1], height])
        from .vector_kernels import up_add

        for level in levels[-2::-1]:
            out = np.empty(level.shape)
            up_add(height, level, out)
            height = out
        return height

    def analyse(self, gradient: np.ndarray, out: list[np.ndarray]) -> None:
        """Apply the adjoint of `synthesise`.

        Parameters
        ----------
        gradient : (H, W) ndarray
        out : list of ndarray
            Output: the gradient of each level, finest first.
        """
        if not self.compiled:
            analyse(gradient, out)
            return
        from .vector_kernels import down

        out[0][...] = gradient
        for fine, coarse in zip(out[:-1], out[1:], strict=True):
            down(fine, coarse)


class ParameterVector:
    """All unknowns of a problem in one vector, and the objective as a function of it.

    The vector contains the pyramid levels of the height and the whitened light, unless they are
    known. Calling the object with ``(x, gradient_out)`` returns the loss at `x`.

    Attributes
    ----------
    x : (N,) ndarray
        Unknowns of the last evaluation.
    terms : Terms
        Terms of the last evaluation.
    evaluations : int
        Number of evaluations.

    Parameters
    ----------
    problem : Problem
    backend : Backend
    levels : int or None
        Levels of the pyramid, see `SolverOptions`.
    known_height : (H, W) ndarray or None
    known_light : (9, C) ndarray or None
    """

    def __init__(
        self,
        problem: Problem,
        backend: Backend,
        levels: int | None,
        known_height: np.ndarray | None,
        known_light: np.ndarray | None,
    ) -> None:
        self._problem, self._backend, self._engine = problem, backend, backend.engine(problem)
        self._known_height, self._known_light = known_height, known_light
        self.shapes = [] if known_height is not None else level_shapes(problem.valid.shape, levels)
        sizes = [int(np.prod(s)) for s in self.shapes]
        self._edges = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        self._light_size = 0 if known_light is not None else problem.priors.light.mean.size
        self.evaluations = 0
        self.channels = problem.priors.channels
        self.x = np.zeros(int(self._edges[-1]) + self._light_size, backend.dtype)
        self.terms = Terms()

    def levels(self, vector: np.ndarray) -> list[np.ndarray]:
        """Return the pyramid levels in a vector.

        Parameters
        ----------
        vector : (N,) ndarray

        Returns
        -------
        list of ndarray
            Views, finest first; none if the height is known.
        """
        return [
            vector[a:b].reshape(s)
            for a, b, s in zip(self._edges[:-1], self._edges[1:], self.shapes, strict=True)
        ]

    def height(self) -> np.ndarray:
        """Return the height (H, W) of `x`."""
        return (
            self._backend.synthesise(self.levels(self.x))
            if self._known_height is None
            else self._known_height
        )

    def light(self) -> np.ndarray:
        """Return the light (9, C) of `x`."""
        if self._known_light is not None:
            return self._known_light
        prior = self._problem.priors.light
        stacked = (
            np.einsum("ij,j->i", prior.unwhiten, self.x[self._edges[-1] :].astype(float))
            + prior.offset
        )
        return unstack(stacked, self.channels)

    def at(self, start: Start) -> np.ndarray:
        """Return the vector of a start; its shape is flat if depth was observed.

        Parameters
        ----------
        start : Start

        Returns
        -------
        (N,) ndarray
        """
        p, x = self._problem, np.zeros_like(self.x)
        self._set_light(x, (start.light - 1) * p.priors.light.offset)
        if self.shapes and p.observation is None:
            self._place_shape(start, self.levels(x))
        return x

    def _place_shape(self, start: Start, levels: list[np.ndarray]) -> None:
        """Write the shape of a start into one of the levels, all 0 before."""
        p = self._problem
        if start.predicted and p.predicted_normals is not None:
            level = min(_PREDICTED_LEVEL, len(levels) - 1)
            levels[level][...] = predicted_height(p.predicted_normals, p.mask, 2**level)
        elif start.dome and p.silhouette is not None:
            level = min(_START_LEVEL, len(levels) - 1)
            height = start.dome * p.silhouette.dome
            for _ in range(level):
                height = down(height) / _COARSER
            levels[level][...] = height

    def _set_light(self, x: np.ndarray, difference: np.ndarray) -> None:
        """Set the light in a vector from its difference (9 C,) to the mean of the prior."""
        if self._known_light is None:
            unwhiten = self._problem.priors.light.unwhiten
            x[self._edges[-1] :] = solve_linear(unwhiten, difference[:, None])[:, 0]

    def __call__(self, x: np.ndarray, gradient: np.ndarray) -> float:
        self.x = x
        self.evaluations += 1
        height, light = self.height(), self.light()
        if not (_is_below(height, _MOST_HEIGHT) and _is_below(light, _MOST_LIGHT)):
            gradient[...] = 0
            return float("inf")  # the line search tries a shorter step
        result = self._engine.evaluate(height, light)
        if self._known_height is None:
            self._backend.analyse(result.height_gradient, self.levels(gradient))
        if self._known_light is None:
            gradient[self._edges[-1] :] = np.einsum(
                "ji,j->i", self._problem.priors.light.unwhiten, stack(result.light_gradient)
            )
        self.terms = result.terms
        return result.terms.total


def _is_below(values: np.ndarray, most: float) -> bool:
    """Whether all magnitudes are below a number; False where one is NaN."""
    return bool(values.max() < most and values.min() > -most)


def solve(
    problem: Problem,
    options: SolverOptions | None = None,
    *,
    known_height: np.ndarray | None = None,
    known_light: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> SirfsResult:
    """Minimise the objective of a problem.

    The detail of progress reports is the loss.

    Parameters
    ----------
    problem : Problem
        Its weights define the starts.
    options : SolverOptions, optional
    known_height : (H, W) ndarray, optional
        Kept as given.
    known_light : (9, C) ndarray, optional
        Kept as given.
    monitor : Monitor, optional

    Returns
    -------
    SirfsResult

    Raises
    ------
    InputError
        If a known shape or light is not finite, the objective has no minimum, or the engine is not
        available.
    Cancelled
        If the monitor cancels.
    """
    options, monitor = options or SolverOptions(), monitor or Monitor()
    for given in (known_height, known_light):
        if given is not None and not np.isfinite(given).all():
            raise InputError(
                "a given shape or light has holes or infinite values: fill them,"
                " or give the shape as depth"
            )
    with ThreadPool(thread_count(options)) as workers:
        backend = Backend(options, workers)
        unknowns = ParameterVector(problem, backend, options.levels, known_height, known_light)
        monitor.report(STAGE, 0.0)
        if unknowns.x.size:
            weights, lbfgs, algebra = problem.weights, options.lbfgs, backend.algebra()
            run = multi_start(unknowns, weights.starts, lbfgs, algebra, monitor)
            outcome = run.run(_reporter(monitor, options.lbfgs.iterations))
            if unknowns.x is not run.x:  # it had converged before another start was tried
                unknowns(run.x, np.empty_like(run.x))
        else:  # everything is known: only the loss is needed
            outcome = LbfgsResult(unknowns(unknowns.x, unknowns.x), 0, 1, "gradient")
        if not np.isfinite(outcome.loss):
            raise InputError(
                "shape and light cannot be recovered, because they grow without limit: check the "
                "known inputs"
            )
        return SirfsResult(
            np.array(unknowns.height(), float),
            np.array(unknowns.light(), float),
            unknowns.terms,
            outcome.iterations,
            unknowns.evaluations,
            outcome.reason,
            outcome.converged,
        )


def multi_start(
    unknowns: ParameterVector,
    starts: Sequence[Start],
    options: LbfgsOptions,
    algebra: Algebra,
    monitor: Monitor,
) -> Minimisation:
    """Choose the minimisation to continue.

    Parameters
    ----------
    unknowns : ParameterVector
    starts : sequence of Start
        Duplicates are ignored.
    options : LbfgsOptions
    algebra : Algebra
    monitor : Monitor
        Receives the lowest loss so far.

    Returns
    -------
    Minimisation
        From the only start, not run yet; of several, the one whose loss is lowest after `_TRIAL`
        evaluations.
    """
    points: list[np.ndarray] = []
    for start in starts:
        point = unknowns.at(start)
        if not any(np.array_equal(point, other) for other in points):
            points.append(point)
    if len(points) == 1:
        return Minimisation(unknowns, points[0], options, algebra)
    runs = [Minimisation(unknowns, point, options, algebra) for point in points]
    report = _lowest_reporter(monitor)
    for run in runs:
        run.run(report, _TRIAL)
    return min(runs, key=lambda run: run.loss)


def _lowest_reporter(monitor: Monitor) -> Callable[[int, float], None]:
    """Report the lowest loss of all starts so far, which is that of the run to be continued."""
    lowest = np.inf

    def each(_: int, loss: float) -> None:
        nonlocal lowest
        lowest = min(lowest, loss)
        monitor.report(STAGE, 0.0, f"loss {lowest:.3f}")

    return each


def _reporter(monitor: Monitor, iterations: int) -> Callable[[int, float], None]:
    def each(iteration: int, loss: float) -> None:
        fraction = 1 - 0.99**iteration if iteration < iterations else 1.0
        monitor.report(STAGE, fraction, f"loss {loss:.3f}")

    return each
