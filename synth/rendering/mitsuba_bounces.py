"""Interreflections on Mitsuba's arrays: light that parts of the object reflect onto each other.

Equation: at each point a direction is sampled from the lobes, with the density q; it contributes
f_r cos / q times the radiance that leaves the part of the object which it hits: direct light there
by one sample of each light, albedo * diffuse + specular, and, while bounces remain, the
contribution of a direction sampled there in the same way. Directions that miss the object
contribute nothing: that light is direct.

Citation: J. T. Kajiya, "The rendering equation", SIGGRAPH 1986, doi:10.1145/15922.15902.

Limits: paths with at most `bounces` reflections before the last one. Materials are evaluated by
NumPy between the waves of rays. Multiple specular reflections are noisy, since they are hit by
chance only.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.progress import Monitor

from ..scene.materials import Material, SurfaceReflectance
from ..scene.surface import Surface
from ..scene.tracing import Tracer
from ..scene.variant import load_mitsuba
from . import Lit, RenderOptions
from .bsdfs import load_drjit, lobes_of, rows_of
from .mitsuba_direct import beam_light, generator, one_sample, points_at
from .mitsuba_lights import Beam, WideLight

_AT_ONCE = 1 << 18  # light paths


@dataclass(frozen=True)
class World:
    """The object and the lights.

    Attributes
    ----------
    material : Material
        The object's material.
    lights : list of Beam or WideLight
        The lights, none of them black.
    tracer : Tracer
        The object.
    """

    material: Material
    lights: list[Beam | WideLight]
    tracer: Tracer


def bounced_light(
    surface: Surface,
    world: World,
    options: RenderOptions,
    random: np.random.Generator,
    monitor: Monitor,
) -> Lit:
    """Light the points of a surface by other parts of the object.

    Parameters
    ----------
    surface : Surface
        N points.
    world : World
        Object and lights.
    options : RenderOptions
        Samples and bounces.
    random : numpy.random.Generator
        Source of seeds.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    Lit
        The interreflections.

    Raises
    ------
    Cancelled
        If the user cancels.
    """
    count = len(surface.position)
    sums, squares = np.zeros((2, count, 3)), np.zeros((2, count, 3))
    wave = max(1, min(options.samples, _AT_ONCE // count))
    for start in range(0, options.samples, wave):
        monitor.report("interreflections", start / options.samples)
        size = min(wave, options.samples - start)
        position, normal, view = (
            np.tile(part, (size, 1)) for part in (surface.position, surface.normal, surface.view)
        )
        reflectance = surface.reflectance
        many = SurfaceReflectance(
            np.tile(reflectance.albedo, (size, 1)),
            np.tile(reflectance.strength, size),
            np.tile(reflectance.gloss, size),
        )
        lobes = np.stack(
            _arriving(position, normal, view, many, world, options.bounces, random)
        ).reshape(2, size, count, 3)
        sums += lobes.sum(axis=1)
        squares += (lobes**2).sum(axis=1)
    means = sums / options.samples
    variances = np.maximum(squares / options.samples - means**2, 0) / (options.samples - 1)
    return Lit(means[0], means[1], variances[0], variances[1])


def _arriving(
    position: np.ndarray,
    normal: np.ndarray,
    view: np.ndarray,
    reflectance: SurfaceReflectance,
    world: World,
    bounces: int,
    random: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """One sample of the light from other parts of the object, on the diffuse lobe (for albedo 1)
    and the specular lobe of the points: (N, 3) each.
    """
    dr, mi = load_drjit(), load_mitsuba()
    points = points_at(position, normal, view, lobes_of(world.material, reflectance))
    numbers = generator(len(position), int(random.integers(1 << 32)))
    place = mi.Point2f(numbers.next_float32(), numbers.next_float32())
    local = points.lobes.sample(points.view, numbers.next_float32(), place)
    density = points.lobes.density(points.view, local)
    useful = (local.z > 0) & (density > 0)
    weights = [
        dr.select(useful, value / dr.select(useful, density, 1), 0)
        for value in points.lobes.values(points.view, local)
    ]
    toward, origin = points.frame.to_world(local), points.origin
    dr.eval(weights, useful, toward, origin)
    direction = rows_of(toward)
    hits = world.tracer.hits(rows_of(origin), direction)
    met = hits.valid & np.array(useful, bool)
    diffuse, gloss = np.zeros((2, len(position), 3))
    if met.any():
        leaving = _leaving(
            hits.position[met],
            hits.normal[met],
            -direction[met],
            world.material.at(hits.uv[met]),
            world,
            bounces,
            random,
        )
        diffuse[met], gloss[met] = (
            np.array(weight, float)[met, None] * leaving for weight in weights
        )
    return diffuse, gloss


def _leaving(
    position: np.ndarray,
    normal: np.ndarray,
    view: np.ndarray,
    reflectance: SurfaceReflectance,
    world: World,
    bounces: int,
    random: np.random.Generator,
) -> np.ndarray:
    """One sample of the radiance that points send toward `view`: (N, 3)."""
    dr = load_drjit()
    points = points_at(position, normal, view, lobes_of(world.material, reflectance))
    numbers = generator(len(position), int(random.integers(1 << 32)))
    diffuse, gloss = (np.zeros((len(position), 3)) for _ in range(2))
    for light in world.lights:
        if isinstance(light, Beam):
            diffuse_part, specular_part = beam_light(points, light, world.tracer)
        else:
            plain, more, specular_part = one_sample(points, light, world.tracer, numbers, 1.0)
            diffuse_part = plain + more
        dr.eval(diffuse_part, specular_part, numbers)
        diffuse += rows_of(diffuse_part)
        gloss += rows_of(specular_part)
    if bounces > 1:
        further = _arriving(position, normal, view, reflectance, world, bounces - 1, random)
        diffuse, gloss = diffuse + further[0], gloss + further[1]
    return reflectance.albedo * diffuse + gloss
