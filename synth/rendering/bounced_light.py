"""Interreflections: light that parts of the object reflect onto each other before it reaches the
camera.

Equation: the radiance that arrives along a sampled direction which hits the object is the radiance
reflected there: direct light by one sample of each kind, and, while bounces remain, the radiance
along one more direction, sampled by the cosine or by the specular lobe with equal probability. The
weights are those of `direct_light`.

Citation: J. T. Kajiya, "The rendering equation", SIGGRAPH 1986, doi:10.1145/15922.15902.

Limits: paths with at most `bounces` reflections before the last one. Specular light on a diffuse
part (caustics) is noisy, since it is hit by chance only.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..scene.lights import Light
from ..scene.materials import Material
from ..scene.tracing import Tracer
from .direct_light import Paths, Sums, add_exactly, draw_paths, trace_paths
from .light_sampling import Sampler
from .reflection import Points, Reflection, cosine_density, cosine_directions


@dataclass(frozen=True)
class World:
    """The object and the lights.

    Attributes
    ----------
    material : Material
        The object's material.
    reflection : Reflection
        The material without its albedo.
    lights : sequence of Light
        All lights.
    samplers : sequence of Sampler
        Of the extended lights.
    tracer : Tracer
        The object.
    """

    material: Material
    reflection: Reflection
    lights: Sequence[Light]
    samplers: Sequence[Sampler]
    tracer: Tracer


def bounced_paths(
    rng: np.random.Generator, points: Points, world: World, samples: tuple[int, int], bounces: int
) -> Paths:
    """Sample the light that arrives from the object itself.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    points : Points
        Where it arrives.
    world : World
        Object and lights.
    samples : (int, int)
        Directions per point, by the cosine and by the specular lobe.
    bounces : int
        Remaining reflections.

    Returns
    -------
    Paths
        The samples.
    """
    direction = np.concatenate(
        [
            cosine_directions(rng, points, samples[0]),
            world.reflection.draw(rng, points, samples[1]),
        ],
        axis=1,
    )
    point, sample = np.nonzero(np.einsum("nsi,ni->ns", direction, points.normal) > 1e-9)
    direction, many = direction[point, sample], points.at(point)
    hit, arriving = _arriving(rng, many, direction, world, bounces)
    many, direction = many.at(hit), direction[hit]
    density = samples[0] * cosine_density(many, direction) + samples[1] * world.reflection.density(
        many, direction
    )
    cosine = np.einsum("ni,ni->n", many.normal, direction)
    return Paths(
        point=point[hit],
        strategy=(sample[hit] >= samples[0]).astype(int),
        half=(sample[hit] - np.where(sample[hit] >= samples[0], samples[0], 0)) % 2,
        samples=samples,
        direction=direction,
        reach=np.full(len(hit), np.inf),
        light=arriving * (cosine / density)[:, None],
        diffuse=world.reflection.diffuse(many, direction),
        gloss=world.reflection.gloss(many, direction),
    )


def _arriving(
    rng: np.random.Generator, points: Points, direction: np.ndarray, world: World, bounces: int
) -> tuple[np.ndarray, np.ndarray]:
    """Which of M rays from the points hit the object (K,), and the radiance along those (K, 3)."""
    met = world.tracer.hits(points.lifted(), direction)
    hit = np.flatnonzero(met.valid)
    reflectance = world.material.at(met.uv[hit])
    places = Points(
        met.position[hit], met.normal[hit], -direction[hit], reflectance.strength, reflectance.gloss
    )
    sums, everything = Sums(len(hit)), slice(0, len(hit))
    for light in world.lights:
        add_exactly(sums, places, world.reflection, light, world.tracer)
    for sampler in world.samplers:
        paths = draw_paths(rng, places, world.reflection, sampler, (1, 1))
        sums.add(everything, paths, trace_paths(places, paths, world.tracer))
    leaving = reflectance.albedo * sums.diffuse + sums.gloss
    if bounces > 1 and len(hit):
        leaving += _one_more(rng, places, reflectance.albedo, world, bounces - 1)
    return hit, leaving


def _one_more(
    rng: np.random.Generator, places: Points, albedo: np.ndarray, world: World, bounces: int
) -> np.ndarray:
    """Radiance (K, 3) that leaves due to the light arriving from the object along one direction."""
    by_cosine, by_gloss = (
        cosine_directions(rng, places, 1)[:, 0],
        world.reflection.draw(rng, places, 1)[:, 0],
    )
    direction = np.where(rng.random((len(places), 1)) < 0.5, by_cosine, by_gloss)
    cosine = np.einsum("ni,ni->n", places.normal, direction)
    leaving = np.zeros((len(places), 3))
    up = np.flatnonzero(cosine > 1e-9)
    hit, arriving = _arriving(rng, places.at(up), direction[up], world, bounces)
    some, direction = places.at(up[hit]), direction[up[hit]]
    density = 0.5 * (cosine_density(some, direction) + world.reflection.density(some, direction))
    reflected = (
        albedo[up[hit]] * world.reflection.diffuse(some, direction)[:, None]
        + world.reflection.gloss(some, direction)[:, None]
    )
    leaving[up[hit]] = reflected * arriving * (cosine[up[hit]] / density)[:, None]
    return leaving
