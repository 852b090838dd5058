"""Light on a surface by Mitsuba's kernels: body and gloss from the same light paths, for all points at once.

Problem: the radiance that each visible point sends to the camera, the two lobes apart, and the variance of the estimate.

Equation: a directional or point light is summed up as it is. For what fills a solid angle each sample draws two directions, one toward the
light with the density p and one toward what the lobes reflect with q, and both count as

    V f_r L cos / (p + q)                                        the balance heuristic; V: nothing stands between

The body takes its shading without shadows from a closed form, S, so that only what shadows change is drawn:
k S + (V f_r - k / pi) L cos / (p + q), for k = pi f_r with the light along the normal. On a convex Lambertian object that has no variance.
Mean and variance are gathered by Welford's updates; samples are independent, the variance of the mean is sum of squares / (n (n - 1)).

Citation: E. Veach, L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995,
doi:10.1145/218380.218498. B. P. Welford, "Note on a method for calculating corrected sums of squares and products", Technometrics 4(3),
419-420 (1962), doi:10.1080/00401706.1962.10490022. W. Jakob et al., Dr.Jit, 2022, doi:10.1145/3528223.3530099.

Limits: LLVM variants only. Light paths that bounce have no closed form. float32.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from isc_core.errors import InputError
from isc_core.progress import Monitor

from ..lights import Light
from ..materials import Material
from ..surface import Surface
from ..tracing import LIFT, Tracer
from ..variant import has_llvm, load_mitsuba
from . import Lit, RenderOptions
from .bsdfs import Lanes, Lobes, load_drjit, lobes_of
from .mitsuba_lights import Beam, WideLight, kernel_light

_AT_ONCE = 1 << 22  # light paths between two reports


@dataclass(frozen=True)
class Points:
    """Points that are lit, a lane each. `origin`: the position lifted off the surface, where rays start. `frame`: z along the normal.
    `view`: in that frame."""

    position: Lanes
    origin: Lanes
    frame: Lanes
    view: Lanes
    lobes: Lobes

    def values(self, direction: Lanes) -> tuple[Lanes, Lanes]:
        """f_r cos of body and gloss for light from a direction."""
        return self.lobes.values(self.view, self.frame.to_local(direction))


def light_surface(
    surface: Surface, material: Material, lights: tuple[Light, ...], tracer: Tracer, options: RenderOptions, monitor: Monitor
) -> Lit:
    """Lights the N points of `surface`; see the package. Raises `InputError` where no LLVM variant runs, `Cancelled`."""
    if not has_llvm():
        raise InputError("Mitsuba's kernels need libLLVM 19 or later (Debian's package: libllvm19): install it, or take renderer 'arrays'")
    random = np.random.default_rng(options.seed)
    points = _points(surface.position, surface.normal, surface.view, lobes_of(material, surface.paint))
    total = Lit(*(np.zeros((len(surface.position), 3)) for _ in range(4)))
    for k, light in enumerate(lights):
        part = monitor.part(k / len(lights), (k + 1) / len(lights))
        kernel = kernel_light(light)
        seed = int(random.integers(1 << 31))
        if isinstance(kernel, Beam):
            total = _sum(total, _beam(points, kernel, tracer))
        elif kernel is not None:
            total = _sum(total, _wide(points, surface, kernel, tracer, options.samples, seed, part))
        part.report("light", 1.0)
    return total


def _points(position: np.ndarray, normal: np.ndarray, view: np.ndarray, lobes: Lobes) -> Points:
    dr, mi = load_drjit(), load_mitsuba()
    place, across, toward = (mi.Vector3f(np.ascontiguousarray(part.T, np.float32)) for part in (position, normal, view))
    frame, origin = mi.Frame3f(across), place + LIFT * across
    local = frame.to_local(toward)
    dr.eval(place, origin, frame, local)
    return Points(mi.Point3f(place), mi.Point3f(origin), frame, local, lobes)


def _visible(points: Points, direction: Lanes, distance: Lanes, needed: Lanes, tracer: Tracer) -> Lanes:
    """Whether nothing stands between the points and what is `distance` away; only where that is needed."""
    mi = load_mitsuba()
    ray = mi.Ray3f(points.origin, direction)
    ray.maxt = mi.Float(distance)
    return needed & ~tracer.scene.ray_test(ray, needed)


def _beam(points: Points, light: Beam, tracer: Tracer) -> Lit:
    dr = load_drjit()
    direction, distance, irradiance = light.arriving(points.position)
    body, gloss = points.values(direction)
    seen = _visible(points, direction, distance, body > 0, tracer)
    body, gloss = (np.array(dr.select(seen, value * irradiance, 0), float).T for value in (body, gloss))
    return Lit(body, gloss, np.zeros_like(body), np.zeros_like(gloss))


def one_sample(points: Points, light: WideLight, tracer: Tracer, random: Lanes, share: Lanes) -> tuple[Lanes, Lanes]:
    """The colours that one sample of a light gives to body and gloss; the body's less `share` of its closed form."""
    dr, mi = load_drjit(), load_mitsuba()

    def draw() -> Lanes:
        return mi.Point2f(random.next_float32(), random.next_float32())

    toward = light.sample(points.position, draw(), draw())
    mirrored = points.frame.to_world(points.lobes.sample(points.view, random.next_float32(), draw()))
    body, gloss = mi.Color3f(0), mi.Color3f(0)
    for direction in (toward, mirrored):
        local = points.frame.to_local(direction)
        radiance, distance, density = light.along(points.position, direction)
        density += points.lobes.density(points.view, local)
        useful = (local.z > 0) & (density > 0)
        radiance = dr.select(useful, radiance / dr.select(useful, density, 1), 0)
        matt, shiny = points.lobes.values(points.view, local)
        seen = _visible(points, direction, distance, useful & (dr.max(radiance) > 0), tracer)
        body += radiance * (dr.select(seen, matt, 0) - share * local.z / math.pi)
        gloss += radiance * dr.select(seen, shiny, 0)
    return body, gloss


def _wide(points: Points, surface: Surface, light: WideLight, tracer: Tracer, samples: int, seed: int, monitor: Monitor) -> Lit:
    dr, mi = load_drjit(), load_mitsuba()
    count = len(surface.position)
    share = math.pi * points.lobes.values(points.view, mi.Vector3f(0, 0, 1))[0]
    dr.eval(share)
    gathered = _Gathered(count, seed)
    chunk = max(1, _AT_ONCE // count)
    for start in range(0, samples, chunk):
        monitor.report("light", start / samples)
        gathered.add(lambda random: one_sample(points, light, tracer, random, share), min(chunk, samples - start))
    lit = gathered.lit()
    flat = light.unoccluded(surface.position, surface.normal) * np.array(share, float)[:, None]
    return Lit(lit.shading + flat, lit.specular, lit.shading_variance, lit.specular_variance)


class _Gathered:
    """Means and sums of squares of a pair of colours, a lane each."""

    def __init__(self, lanes: int, seed: int) -> None:
        dr, mi = load_drjit(), load_mitsuba()
        self.random = mi.PCG32(lanes)
        first, second = mi.sample_tea_32(dr.opaque(mi.UInt32, seed), dr.arange(mi.UInt32, lanes))
        self.random.seed(mi.UInt64(first), mi.UInt64(second))
        self.count = 0
        self.means = [dr.zeros(mi.Color3f, lanes) for _ in range(2)]
        self.squares = [dr.zeros(mi.Color3f, lanes) for _ in range(2)]
        dr.make_opaque(self.random, self.means, self.squares)

    def add(self, estimate: Callable[[Lanes], tuple[Lanes, Lanes]], samples: int) -> None:
        dr, mi = load_drjit(), load_mitsuba()
        end = dr.opaque(mi.UInt32, self.count + samples)

        def step(k: Lanes, random: Lanes, means: list[Lanes], squares: list[Lanes]) -> tuple[Lanes, ...]:
            k = k + 1
            new_means, new_squares = [], []
            for value, mean, square in zip(estimate(random), means, squares, strict=True):
                away = value - mean
                new_means.append(mean + away / mi.Float(k))
                new_squares.append(square + away * (value - new_means[-1]))
            return k, random, new_means, new_squares

        state = (dr.opaque(mi.UInt32, self.count), self.random, self.means, self.squares)
        _, self.random, self.means, self.squares = dr.while_loop(state, lambda k, *_: k < end, step)
        dr.eval(self.random, self.means, self.squares)
        self.count += samples

    def lit(self) -> Lit:
        parts = [np.array(part, float).T for part in (*self.means, *self.squares)]
        spread = self.count * (self.count - 1)
        return Lit(parts[0], parts[1], parts[2] / spread, parts[3] / spread)


def _sum(a: Lit, b: Lit) -> Lit:
    """Lights add up; so do the variances of estimates that share no random numbers."""
    return Lit(
        a.shading + b.shading,
        a.specular + b.specular,
        a.shading_variance + b.shading_variance,
        a.specular_variance + b.specular_variance,
    )
