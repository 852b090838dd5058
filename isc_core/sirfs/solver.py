"""Shape and illumination from one image: the minimiser of the SIRFS objective (Barron & Malik 2015).

One L-BFGS run moves the height's pyramid levels and the whitened light together. Halved problems come first: their pyramid is
the upper part of the full one, so that what they find is the start of the next. Reflectance is not an unknown:
log A = log I - log shading reproduces the image exactly.
Source: Barron & Malik, "Shape, Illumination, and Reflectance from Shading", TPAMI 37(8), 2015, doi:10.1109/TPAMI.2014.2377712.
"""

import os
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from ..errors import InputError
from ..progress import Monitor
from .contour import occluding_contour
from .illumination import stack, unstack
from .lbfgs import Algebra, LbfgsOptions, LbfgsResult, NumpyAlgebra, minimise
from .numpy_engine import NumpyEngine
from .problem import DepthObservation, Evaluation, Problem, Terms
from .pyramid import analyse, level_shapes, synthesise
from .silhouette import silhouette_field
from .workers import Workers

_LEAST_COARSE = 40  # pixels on the short side, below which a halved problem no longer shows the object


@dataclass(frozen=True)
class SolverOptions:
    """How a problem is solved; none of it changes what is solved.

    `engine`: "numba", "numpy", or "auto" for compiled kernels where they can be had. `single`: float32 unknowns (production)
    or float64. `threads`: 0 for all cores. `halvings`: problems of half, quarter ... size that are solved first.
    `levels`: of the height's pyramid, None for as many as make sense. `lbfgs`: the optimiser's, at full size;
    `coarse_lbfgs`: the same for halved problems.
    """

    engine: str = "auto"
    single: bool = True
    threads: int = 0
    halvings: int = 0
    levels: int | None = None
    lbfgs: LbfgsOptions = field(default_factory=LbfgsOptions)
    coarse_lbfgs: LbfgsOptions = field(default_factory=LbfgsOptions)


@dataclass(frozen=True)
class SirfsResult:
    """`height`: (H, W) float64, pixels, toward the viewer. `light`: (9, C) float64, reference convention.

    `terms`: of the objective there. `evaluations`: at full size and in all; `reason`: why the optimiser stopped.
    """

    height: np.ndarray
    light: np.ndarray
    terms: Terms
    iterations: int
    evaluations: int
    total_evaluations: int
    reason: str
    converged: bool


class Engine(Protocol):
    """Something that evaluates the objective."""

    def evaluate(self, height: np.ndarray, light: np.ndarray) -> Evaluation:
        """The objective and its gradients at `height` (H, W) and `light` (9, C)."""
        ...


def compiled_engine_available() -> bool:
    """Whether Numba can be imported here."""
    try:
        import numba  # noqa: F401
    except ImportError:
        return False
    return True


def thread_count(options: SolverOptions) -> int:
    """How many threads `options` ask for on this machine."""
    return options.threads or os.cpu_count() or 1


class _Tools:
    """The engine and its algebra, chosen once for a solve."""

    def __init__(self, options: SolverOptions, workers: Workers) -> None:
        if options.engine not in ("auto", "numba", "numpy"):
            raise InputError(f'unknown engine "{options.engine}": choose auto, numba or numpy')
        self.compiled = options.engine != "numpy" and compiled_engine_available()
        if options.engine == "numba" and not self.compiled:
            raise InputError("the engine numba needs the package numba: install it, or choose --engine numpy")
        self.dtype: type[np.floating] = np.float32 if options.single else np.float64
        self._workers = workers

    def engine(self, problem: Problem) -> Engine:
        if not self.compiled:
            return NumpyEngine(problem, self.dtype)
        from .numba_engine import NumbaEngine

        return NumbaEngine(problem, self.dtype, self._workers)

    def algebra(self) -> Algebra:
        if not self.compiled:
            return NumpyAlgebra()
        from .vector_kernels import CompiledAlgebra

        return CompiledAlgebra(self._workers)

    def synthesise(self, levels: list[np.ndarray]) -> np.ndarray:
        if not self.compiled:
            return synthesise(levels)
        from .vector_kernels import up_add

        height = levels[-1]
        for level in levels[-2::-1]:
            out = np.empty_like(level)
            up_add(height, level, out)
            height = out
        return height

    def analyse(self, gradient: np.ndarray, out: list[np.ndarray]) -> None:
        if not self.compiled:
            analyse(gradient, out)
            return
        from .vector_kernels import down

        out[0][...] = gradient
        for fine, coarse in zip(out[:-1], out[1:], strict=True):
            down(fine, coarse)


class _Unknowns:
    """One vector that holds the pyramid levels and the whitened light, or only what is not known beforehand."""

    def __init__(
        self, problem: Problem, tools: _Tools, levels: int | None, known_height: np.ndarray | None, known_light: np.ndarray | None
    ) -> None:
        self._problem, self._tools, self._engine = problem, tools, tools.engine(problem)
        self._known_height, self._known_light = known_height, known_light
        self.shapes = [] if known_height is not None else level_shapes(problem.valid.shape, levels)
        sizes = [int(np.prod(s)) for s in self.shapes]
        self._edges = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        self._light_size = 0 if known_light is not None else problem.priors.light.mean.size
        self.evaluations = 0
        self.channels = problem.priors.channels
        self.x = np.zeros(int(self._edges[-1]) + self._light_size, tools.dtype)
        self.terms = Terms()

    def levels(self, vector: np.ndarray) -> list[np.ndarray]:
        """Views of the pyramid levels in `vector`."""
        return [vector[a:b].reshape(s) for a, b, s in zip(self._edges[:-1], self._edges[1:], self.shapes, strict=True)]

    def height(self) -> np.ndarray:
        return self._tools.synthesise(self.levels(self.x)) if self._known_height is None else self._known_height

    def light(self) -> np.ndarray:
        if self._known_light is not None:
            return self._known_light
        prior = self._problem.priors.light
        stacked = prior.unwhiten @ self.x[self._edges[-1] :].astype(float) + prior.offset
        return unstack(stacked, self.channels)

    def set_light(self, light: np.ndarray) -> None:
        if self._known_light is None:
            prior = self._problem.priors.light
            self.x[self._edges[-1] :] = np.linalg.solve(prior.unwhiten, stack(light) - prior.offset)

    def __call__(self, x: np.ndarray, gradient: np.ndarray) -> float:
        assert x is self.x
        self.evaluations += 1
        result = self._engine.evaluate(self.height(), self.light())
        if self._known_height is None:
            self._tools.analyse(result.height_gradient, self.levels(gradient))
        if self._known_light is None:
            gradient[self._edges[-1] :] = self._problem.priors.light.unwhiten.T @ stack(result.light_gradient)
        self.terms = result.terms
        return result.terms.total


def solve(
    problem: Problem,
    options: SolverOptions | None = None,
    *,
    known_height: np.ndarray | None = None,
    known_light: np.ndarray | None = None,
    start: tuple[np.ndarray, np.ndarray] | None = None,
    monitor: Monitor | None = None,
) -> SirfsResult:
    """Minimises the objective of `problem`.

    `start`: height (H, W) and light (9, C) to begin with, instead of a flat shape and no
    light. `known_height` (H, W) or `known_light` (9, C) are kept as given. Progress reports carry the loss. Raises `Cancelled`.
    """
    options, monitor = options or SolverOptions(), monitor or Monitor()
    for given in (known_height, known_light, *(start or ())):
        if given is not None and not np.isfinite(given).all():
            raise InputError("a given shape or light has holes or infinite values: fill them, or give the shape as depth")
    with Workers(thread_count(options)) as workers:
        tools = _Tools(options, workers)
        full_levels = len(level_shapes(problem.valid.shape, options.levels))
        direct = known_height is not None or start is not None
        stages = [problem] if direct else _stages(problem, min(options.halvings, full_levels - 1))
        previous: _Unknowns | None = None
        total = 0
        for k, stage in enumerate(stages):
            halvings = len(stages) - 1 - k
            unknowns = _Unknowns(stage, tools, full_levels - halvings, known_height, known_light)
            _begin(unknowns, previous, start)
            share = monitor.part(1 - 0.75**k if k else 0.0, 1 - 0.75 ** (k + 1) if halvings else 1.0)
            limits = options.coarse_lbfgs if halvings else options.lbfgs
            share.report("shape and light", 0.0)
            if not unknowns.x.size:
                outcome = LbfgsResult(unknowns(unknowns.x, unknowns.x), 0, 1, "gradient")  # all is known: only the loss is asked for
            else:
                outcome = minimise(unknowns, unknowns.x, limits, tools.algebra(), _reporter(share, limits.iterations))
            total += unknowns.evaluations
            previous = unknowns
        return SirfsResult(
            np.array(unknowns.height(), float), np.array(unknowns.light(), float), unknowns.terms,
            outcome.iterations, outcome.evaluations, total, outcome.reason, outcome.converged,
        )  # fmt: skip


def _reporter(monitor: Monitor, most: int):  # type: ignore[no-untyped-def]
    def each(iteration: int, loss: float) -> None:
        monitor.report(f"shape and light, loss {loss:.3f}", 1 - 0.99**iteration if iteration < most else 1.0)

    return each


def _begin(unknowns: _Unknowns, previous: _Unknowns | None, start: tuple[np.ndarray, np.ndarray] | None) -> None:
    """Sets the unknowns to `start`, else to what the halved problem found, else to a flat shape without light."""
    if start is not None:
        if unknowns.shapes:
            unknowns.levels(unknowns.x)[0][...] = start[0]
        unknowns.set_light(start[1])
        return
    if previous is None:
        unknowns.set_light(np.zeros((9, unknowns.channels)))
        return
    unknowns.set_light(previous.light())
    for target, source in zip(unknowns.levels(unknowns.x)[1:], previous.levels(previous.x), strict=True):
        target[...] = source


def _stages(problem: Problem, halvings: int) -> list[Problem]:
    """The problem and its halved versions, the coarsest first; fewer where the object would all but vanish."""
    stages = [problem]
    while len(stages) <= halvings and min(stages[0].valid.shape) >= 2 * _LEAST_COARSE:
        coarser = halved(stages[0])
        if 8 * np.count_nonzero(coarser.valid) < np.count_nonzero(stages[0].valid):
            break
        stages.insert(0, coarser)
    return stages


def halved(problem: Problem) -> Problem:
    """`problem` at half the size: intensities averaged over the valid pixels of 2 x 2 blocks."""
    weight = _block_mean(problem.valid.astype(float))
    valid = weight >= 0.5
    image = _block_mean(np.where(problem.valid[..., None], np.exp(problem.log_image), 0.0))
    log_image = np.where(valid[..., None], np.log(np.where(valid[..., None], image, 1) / np.where(valid, weight, 1)[..., None]), 0.0)
    mask = _block_mean(problem.mask.astype(float)) >= 0.5
    observation = problem.observation
    if observation is not None:
        seen = np.isfinite(observation.height)
        share = _block_mean(seen.astype(float))
        mean = _block_mean(np.where(seen, observation.height, 0.0)) / np.where(share > 0, share, 1)
        observation = DepthObservation(np.where(share > 0, mean / 2, np.nan), observation.sigma / 2, observation.weight)
    return replace(
        problem, log_image=log_image, valid=valid, mask=mask, contour=occluding_contour(mask),
        silhouette=None if problem.priors.silhouette is None else silhouette_field(mask, problem.priors.silhouette),
        observation=observation, curvature_unit=problem.curvature_unit / 2,
    )  # fmt: skip


def _block_mean(image: np.ndarray) -> np.ndarray:
    """Means of 2 x 2 blocks; an odd last row or column is repeated."""
    pad = [(0, n % 2) for n in image.shape[:2]] + [(0, 0)] * (image.ndim - 2)
    even = np.pad(image, pad, mode="edge")
    return (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) / 4
