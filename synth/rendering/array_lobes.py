"""Lighting of a surface with NumPy arrays, the two lobes of its material separate; Mitsuba only
traces the rays.

The estimates are those of `direct_light` and `bounced_light`. Points are processed in chunks with
their own random numbers: threads draw the samples of the next chunks while one thread, which owns
Mitsuba's variant, traces the rays of this one. The result does not depend on the threads.

Limits: see `direct_light`, `bounced_light`, `reflection`.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from isc_core.progress import Monitor

from ..scene.lights import EnvironmentLight, Light, PanelLight
from ..scene.materials import Material
from ..scene.surface import Surface
from ..scene.tracing import Tracer
from . import Lit, RenderOptions
from .bounced_light import World, bounced_paths
from .direct_light import Paths, Sums, add_exactly, draw_paths, trace_paths, unshadowed
from .light_sampling import Sampler, sampler_of
from .reflection import Points, Reflection

CHUNK = 1 << 15  # samples at a time: their arrays fit into the cache
THREADS = 4  # more would wait for the rays, which a single thread traces


def light_surface(
    surface: Surface,
    material: Material,
    lights: tuple[Light, ...],
    tracer: Tracer,
    options: RenderOptions,
    monitor: Monitor,
) -> Lit:
    """Light the points of a surface, see `synth.rendering.light_surface`.

    Parameters
    ----------
    surface : Surface
        The visible points.
    material : Material
        Their material.
    lights : tuple of Light
        The lights.
    tracer : Tracer
        The object.
    options : RenderOptions
        Samples, seed and bounces.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    Lit
        Shading and specular radiance.

    Raises
    ------
    Cancelled
        If the user cancels.
    """
    points = Points(
        surface.position,
        surface.normal,
        surface.view,
        surface.reflectance.strength,
        surface.reflectance.gloss,
    )
    samples = (options.samples, options.samples)
    wide = [light for light in lights if isinstance(light, PanelLight | EnvironmentLight)]
    sampled = [(light, sampler) for light in wide if (sampler := sampler_of(light)) is not None]
    world = World(
        material, Reflection(material), lights, [sampler for _, sampler in sampled], tracer
    )
    parts = len(sampled) + bool(options.bounces)
    total = Sums(len(points))
    for light in lights:
        add_exactly(total, points, world.reflection, light, tracer)
    with ThreadPoolExecutor(min(THREADS, os.cpu_count() or 1)) as pool:
        for number, (light, sampler) in enumerate(sampled):
            part = monitor.part(number / parts, (number + 1) / parts)
            _add_direct(
                total, points, world, (light, sampler), samples, (options.seed, number), pool, part
            )
    if options.bounces:
        last = monitor.part(len(sampled) / parts, 1)
        _add_bounced(
            total, points, world, samples, (options.seed, len(sampled)), options.bounces, last
        )
    return Lit(total.diffuse, total.gloss, total.diffuse_variance, total.gloss_variance)


def _add_direct(
    total: Sums,
    points: Points,
    world: World,
    source: tuple[PanelLight | EnvironmentLight, Sampler],
    samples: tuple[int, int],
    seed: tuple[int, int],
    pool: ThreadPoolExecutor,
    monitor: Monitor,
) -> None:
    """Add one extended light."""
    known = unshadowed(points, world.reflection, source[0])

    def draw(chunk: slice) -> Paths:
        return draw_paths(
            np.random.default_rng((*seed, chunk.start)),
            points.at(chunk),
            world.reflection,
            source[1],
            samples,
        )

    chunks = _chunks(len(points), sum(samples))
    for number, (chunk, paths) in enumerate(_ahead(pool, draw, chunks)):
        monitor.report("lighting", number / len(chunks))
        total.add(chunk, paths, trace_paths(points.at(chunk), paths, world.tracer), known.at(chunk))


def _add_bounced(
    total: Sums,
    points: Points,
    world: World,
    samples: tuple[int, int],
    seed: tuple[int, int],
    bounces: int,
    monitor: Monitor,
) -> None:
    """Add interreflections."""
    chunks = _chunks(len(points), sum(samples))
    for number, chunk in enumerate(chunks):
        monitor.report("interreflections", number / len(chunks))
        paths = bounced_paths(
            np.random.default_rng((*seed, chunk.start)), points.at(chunk), world, samples, bounces
        )
        total.add(chunk, paths, np.ones(len(paths.point), bool))


def _chunks(count: int, samples: int) -> list[slice]:
    """Split `count` points into pieces of about `CHUNK` samples."""
    step = max(1, CHUNK // samples)
    return [slice(start, min(start + step, count)) for start in range(0, count, step)]


def _ahead(
    pool: ThreadPoolExecutor, work: Callable[[slice], Paths], chunks: list[slice]
) -> Iterator[tuple[slice, Paths]]:
    """Yield results in the order of the chunks, with a few of them being computed ahead."""
    waiting: deque[tuple[slice, Future[Paths]]] = deque()
    for chunk in chunks:
        waiting.append((chunk, pool.submit(work, chunk)))
        if len(waiting) > THREADS:
            done, future = waiting.popleft()
            yield done, future.result()
    for done, future in waiting:
        yield done, future.result()
