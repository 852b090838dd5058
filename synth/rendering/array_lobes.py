"""Light on a surface in plain arrays, the two lobes of its material apart; Mitsuba traces the rays and does nothing else.

Problem: radiance toward the camera is, for each lobe f, the integral of f V L cos over the directions w to a light L, with V = 0 where the
object itself stands in between.

Equation: point and directional lights are one direction each: no noise. For panels and environments half of the samples are drawn toward
the light and half where the gloss reflects (matt: by the cosine); with n_k samples of density p_k each sample adds

    f V L cos / sum_k n_k p_k          (the balance heuristic)

Under environments the body only estimates what it loses: b times the closed form without shadows, plus (V f - b / pi) L cos / ..., where b
is pi f for light along the normal. A matt convex body has no noise at all. Light between parts of the object starts along drawn directions
that hit it, and takes one sample of everything from there.

Citation: E. Veach, L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995,
doi:10.1145/218380.218498; control variates: J. M. Hammersley, D. C. Handscomb, "Monte Carlo methods" (1964),
doi:10.1007/978-94-009-5819-7.

Limits: panels do not hide each other or the environment. The variance is estimated from the samples themselves: where light is so rare that
none of them met it, it is 0 and wrong.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from isc_core.progress import Monitor

from ..lights import DirectionalLight, EnvironmentLight, Light, PointLight
from ..materials import Material
from ..surface import Surface
from ..tracing import LIFT, Tracer
from . import Lit, RenderOptions
from .irradiance import unoccluded_shading
from .light_sampling import Sampler, sampler_of
from .reflection import Points, Reflection

_CHUNK = 1 << 15  # samples at a time: their arrays fit the cache
_THREADS = 4  # more would wait for the rays, which one thread traces


def light_surface(
    surface: Surface, material: Material, lights: tuple[Light, ...], tracer: Tracer, options: RenderOptions, monitor: Monitor
) -> Lit:
    """Lights the points of `surface`, see `synth.rendering.light_surface`. Raises `Cancelled`."""
    points = Points(surface.position, surface.normal, surface.view, surface.paint.strength, surface.paint.gloss)
    reflection = Reflection(material)
    total = _Sums(len(points))
    for light in lights:
        _add_exactly(total, points, reflection, light, tracer)
    samplers = [(light, sampler) for light in lights if (sampler := sampler_of(light)) is not None]
    with ThreadPoolExecutor(min(_THREADS, os.cpu_count() or 1)) as pool:
        for number, (light, sampler) in enumerate(samplers):
            estimate = _Estimate(points, reflection, light, sampler, options.samples, (options.seed, number))
            _add_sampled(total, estimate, tracer, pool, monitor.part(number / len(samplers), (number + 1) / len(samplers)))
    return Lit(total.body, total.gloss, total.body_variance, total.gloss_variance)


class _Sums:
    """The lobes of N points as they grow, (N, 3) each, and the variances of both."""

    def __init__(self, count: int) -> None:
        self.body, self.gloss, self.body_variance, self.gloss_variance = np.zeros((4, count, 3))


@dataclass(frozen=True)
class _Paths:
    """M samples that bring light unless something is in the way. `point`: (M,), which point of the chunk. `strategy`: (M,), what drew it.
    `direction`: (M, 3); `reach`: (M,), how far the light is; `light`: (M, 3), L cos / sum n p; `body`, `gloss`: (M,), f of both lobes."""

    point: np.ndarray
    strategy: np.ndarray
    direction: np.ndarray
    reach: np.ndarray
    light: np.ndarray
    body: np.ndarray
    gloss: np.ndarray


class _Estimate:
    """How one light that has a size is sampled at many points, chunk by chunk; each chunk has random numbers of its own."""

    def __init__(self, points: Points, reflection: Reflection, light: Light, sampler: Sampler, samples: int, seed: tuple[int, int]) -> None:
        self.points, self._reflection, self._sampler, self._seed = points, reflection, sampler, seed
        # Two samples at least of either kind, or there is no variance.
        self.counts = (max(2, samples - samples // 2), max(2, samples // 2))
        self.baseline = np.zeros(len(points))
        self.known = np.zeros((len(points), 3))
        if isinstance(light, EnvironmentLight):
            self.baseline = np.pi * reflection.body(points, points.normal)
            self.known = self.baseline[:, None] * unoccluded_shading(light.radiance, points.normal)

    def chunks(self) -> list[slice]:
        """The points, in pieces of about `_CHUNK` samples."""
        step = max(1, _CHUNK // sum(self.counts))
        return [slice(start, min(start + step, len(self.points))) for start in range(0, len(self.points), step)]

    def draw(self, chunk: slice) -> _Paths:
        """The samples of a chunk that can bring light."""
        points = self.points.at(chunk)
        rng = np.random.default_rng((*self._seed, chunk.start))
        to_light = self._sampler.draw(rng, points.position, self.counts[0])
        by_lobe = self._reflection.draw(rng, points, self.counts[1])
        direction = np.concatenate([to_light, by_lobe], axis=1)
        cosine = np.einsum("nsi,ni->ns", direction, points.normal)
        point, sample = np.nonzero(cosine > 1e-9)
        seen = self._sampler.seen(points.position[point], direction[point, sample])
        bright = seen.radiance.any(axis=1)
        point, sample = point[bright], sample[bright]
        direction, many = direction[point, sample], points.at(point)
        density = self.counts[0] * seen.density[bright] + self.counts[1] * self._reflection.density(many, direction)
        return _Paths(
            point=point,
            strategy=(sample >= self.counts[0]).astype(int),
            direction=direction,
            reach=seen.distance[bright],
            light=seen.radiance[bright] * (cosine[point, sample] / density)[:, None],
            body=self._reflection.body(many, direction),
            gloss=self._reflection.gloss(many, direction),
        )

    def add(self, total: _Sums, chunk: slice, paths: _Paths, clear: np.ndarray) -> None:
        """Adds a chunk, of whose samples the `clear` (M,) ones reach their light."""
        body = clear * paths.body - self.baseline[chunk][paths.point] / np.pi
        count = chunk.stop - chunk.start
        total.body[chunk] += self.known[chunk]
        for lobe, mean, variance in (
            (body, total.body, total.body_variance),
            (clear * paths.gloss, total.gloss, total.gloss_variance),
        ):
            for channel in range(3):
                values = lobe * paths.light[:, channel]
                estimate, noise = _sum_and_variance(values, paths.strategy * count + paths.point, count, self.counts)
                mean[chunk, channel] += estimate
                variance[chunk, channel] += noise


def _sum_and_variance(values: np.ndarray, cell: np.ndarray, count: int, samples: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Sums (count,) of samples over the strategies, and their variances. `cell`: strategy * count + point; what lacks is 0."""
    sums = np.bincount(cell, values, 2 * count).reshape(2, count)
    squares = np.bincount(cell, values * values, 2 * count).reshape(2, count)
    many = np.array(samples, float)[:, None]
    spread = np.maximum(squares - sums**2 / many, 0) * many / (many - 1)
    return sums.sum(0), spread.sum(0)


def _add_sampled(total: _Sums, estimate: _Estimate, tracer: Tracer, pool: ThreadPoolExecutor, monitor: Monitor) -> None:
    """Chunk by chunk: threads draw samples ahead, this one traces their rays (Mitsuba's variant belongs to a thread) and adds them."""
    chunks = estimate.chunks()
    for number, (chunk, paths) in enumerate(_ahead(pool, estimate.draw, chunks)):
        monitor.report("lighting", number / len(chunks))
        origins = lifted(estimate.points.at(chunk))[paths.point]
        clear = ~tracer.blocked(origins, paths.direction, paths.reach)
        estimate.add(total, chunk, paths, clear)


def _ahead(pool: ThreadPoolExecutor, work: Callable[[slice], _Paths], chunks: list[slice]) -> Iterator[tuple[slice, _Paths]]:
    """Results in the order of the chunks, a few of them under way at any time."""
    waiting: deque[tuple[slice, Future[_Paths]]] = deque()
    for chunk in chunks:
        waiting.append((chunk, pool.submit(work, chunk)))
        if len(waiting) > _THREADS:
            done, future = waiting.popleft()
            yield done, future.result()
    for done, future in waiting:
        yield done, future.result()


def lifted(points: Points) -> np.ndarray:
    """Where rays from the points start, (N, 3)."""
    return points.position + LIFT * points.normal


def _add_exactly(total: _Sums, points: Points, reflection: Reflection, light: Light, tracer: Tracer) -> None:
    """Adds a light without a size: one direction from each point, one ray, no noise."""
    if isinstance(light, DirectionalLight):
        toward, reach = np.broadcast_to(np.asarray(light.direction, float), points.position.shape), np.full(len(points), np.inf)
        beam = np.broadcast_to(np.asarray(light.irradiance, float), points.position.shape)
    elif isinstance(light, PointLight):
        toward = light.position - points.position
        reach = np.sqrt((toward * toward).sum(1))
        toward = toward / reach[:, None]
        beam = light.intensity / np.square(reach)[:, None]
    else:
        return
    cosine = (points.normal * toward).sum(1)
    lit = np.flatnonzero(cosine > 1e-9)
    lit = lit[~tracer.blocked(lifted(points.at(lit)), toward[lit], reach[lit])]
    some, arriving = points.at(lit), beam[lit] * cosine[lit, None]
    total.body[lit] += reflection.body(some, toward[lit])[:, None] * arriving
    total.gloss[lit] += reflection.gloss(some, toward[lit])[:, None] * arriving
