"""Lighting of a surface by Mitsuba's kernels: diffuse and specular lobes from the same light paths,
for all points at once.

Problem: the radiance that each visible point sends to the camera, the two lobes separate, and the
variance of the estimate.

Equation: directional and point lights are evaluated exactly. For extended lights each sample takes
two directions, one toward the light with the density p and one from the lobes with q, and both
count as

    V f_r L cos / (p + q)        the balance heuristic; V: visibility

The shading of the diffuse lobe without shadows is known in closed form, S, so that only the effect
of shadows is sampled: a k S + (V f_r - a k / pi) L cos / (p + q), k = pi f_r with the light along
the normal, a the unshadowed share of the light. That share is estimated by the other half of the
samples, so the mean is unbiased. A convex Lambertian object has no variance, nor has full shadow.
Samples are independent: the variance of a mean is their sum of squares / (n (n - 1)), accumulated
by Welford's updates.

Citation: E. Veach, L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo
rendering", SIGGRAPH 1995, doi:10.1145/218380.218498. B. P. Welford, "Note on a method for
calculating corrected sums of squares and products", Technometrics 4(3), 419-420 (1962),
doi:10.1080/00401706.1962.10490022. W. Jakob et al., Dr.Jit, 2022, doi:10.1145/3528223.3530099.

Limits: CUDA and LLVM variants only; float32. If no sample hits a rare shadow or glint, both mean
and variance are wrong: compare renders with similar numbers of samples, or take many.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from isc_core.errors import InputError
from isc_core.progress import Monitor

from ..scene.lights import Light
from ..scene.materials import Material, SurfaceReflectance
from ..scene.surface import Surface
from ..scene.tracing import Tracer
from ..scene.variant import is_vectorised, load_mitsuba
from . import Lit, RenderOptions
from .bsdfs import Lanes, load_drjit, lobes_of, rows_of
from .mitsuba_bounces import World, bounced_light
from .mitsuba_direct import Points, beam_light, generator, one_sample, points_at
from .mitsuba_lights import Beam, WideLight, kernel_light

_POINTS = 1 << 17  # points at a time, to limit memory
_AT_ONCE = 1 << 22  # light paths between two reports
_DIVISIBLE = 4  # fewest samples for a variance in either half


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
    InputError
        If Mitsuba runs in a scalar variant.
    Cancelled
        If the user cancels.
    """
    if not is_vectorised():
        raise InputError(
            "Mitsuba's kernels need a graphics card with CUDA and OptiX, or libLLVM 19 or later: "
            "install it (Debian: libllvm19), or use the renderer 'arrays'"
        )
    random = np.random.default_rng(options.seed)
    world = World(
        material,
        [kernel for light in lights if (kernel := kernel_light(light)) is not None],
        tracer,
    )
    count = len(surface.position)
    pieces = []
    for start in range(0, count, _POINTS):
        end = min(start + _POINTS, count)
        pieces.append(
            _light(
                _piece(surface, slice(start, end)),
                world,
                options,
                random,
                monitor.part(start / count, end / count),
            )
        )
    return Lit(
        *(np.concatenate([getattr(piece, field.name) for piece in pieces]) for field in fields(Lit))
    )


def _piece(surface: Surface, chosen: slice) -> Surface:
    """Some of the points of a surface, with the same mask."""
    reflectance = SurfaceReflectance(
        surface.reflectance.albedo[chosen],
        surface.reflectance.strength[chosen],
        surface.reflectance.gloss[chosen],
    )
    return Surface(
        mask=surface.mask,
        position=surface.position[chosen],
        normal=surface.normal[chosen],
        view=surface.view[chosen],
        uv=surface.uv[chosen],
        reflectance=reflectance,
    )


def _light(
    surface: Surface,
    world: World,
    options: RenderOptions,
    random: np.random.Generator,
    monitor: Monitor,
) -> Lit:
    # Two lanes per point, so that each half of the samples has its own moments.
    halves = 2 if options.samples >= _DIVISIBLE else 1
    reflectance = SurfaceReflectance(
        *(
            np.concatenate([part] * halves)
            for part in (
                surface.reflectance.albedo,
                surface.reflectance.strength,
                surface.reflectance.gloss,
            )
        )
    )
    position, normal, view = (
        np.tile(part, (halves, 1)) for part in (surface.position, surface.normal, surface.view)
    )
    points = points_at(position, normal, view, lobes_of(world.material, reflectance))
    count = len(surface.position)
    total = _dark(count)
    jobs = len(world.lights) + bool(options.bounces)
    for k, light in enumerate(world.lights):
        part, seed = monitor.part(k / jobs, (k + 1) / jobs), int(random.integers(1 << 32))
        part.report("light", 0.0)
        if isinstance(light, Beam):
            total = _sum(total, _exact(points, count, light, world.tracer))
        else:
            gathered = _gather(
                points,
                halves * count,
                light,
                world.tracer,
                -(-options.samples // halves),
                seed,
                part,
            )
            total = _sum(total, _joined(gathered.moments(halves), _known(points, surface, light)))
    if options.bounces:
        total = _sum(
            total,
            bounced_light(surface, world, options, random, monitor.part((jobs - 1) / jobs, 1)),
        )
    monitor.report("light", 1.0)
    return total


def _dark(count: int) -> Lit:
    return Lit(*(np.zeros((count, 3)) for _ in range(4)))


def _exact(points: Points, count: int, light: Beam, tracer: Tracer) -> Lit:
    parts = [rows_of(colour)[:count] for colour in beam_light(points, light, tracer)]
    return Lit(*parts, *(np.zeros_like(part) for part in parts))


def _flat(points: Points) -> Lanes:
    """The albedo of a Lambertian surface that approximates the diffuse lobe: equal for light along
    the normal.
    """
    return math.pi * points.lobes.values(points.view, load_mitsuba().Vector3f(0, 0, 1))[0]


def _known(points: Points, surface: Surface, light: WideLight) -> np.ndarray:
    """The shading, (N, 3), of such a surface without shadows."""
    count = len(surface.position)
    return (
        light.unoccluded(surface.position, surface.normal)
        * np.resize(np.array(_flat(points), float), 2 * count)[:count, None]
    )


def _gather(
    points: Points,
    lanes: int,
    light: WideLight,
    tracer: Tracer,
    samples: int,
    seed: int,
    monitor: Monitor,
) -> "_Gathered":
    flat = _flat(points)
    load_drjit().eval(flat)
    gathered, chunk = _Gathered(lanes, seed), max(1, _AT_ONCE // lanes)
    for start in range(0, samples, chunk):
        monitor.report("light", start / samples)
        gathered.add(
            lambda random: one_sample(points, light, tracer, random, flat),
            min(chunk, samples - start),
        )
    return gathered


@dataclass(frozen=True, eq=False)
class _Moments:
    """Moments of `count` samples of (plain, more, specular), see `one_sample`: (N, 3) each.

    `means`; `spreads`: sums of squares about the mean; `common`: sum of products of plain and more
    about their means.
    """

    count: int
    means: list[np.ndarray]
    spreads: list[np.ndarray]
    common: np.ndarray

    def clear_share(self) -> np.ndarray:
        """The unshadowed share of the light of each point, (N, 1) in [0, 1]."""
        plain, more = (mean.sum(axis=1, keepdims=True) for mean in self.means[:2])
        return np.clip(1 + more / np.where(plain > 0, plain, 1), 0, 1)

    def lit(self, known: np.ndarray, share: np.ndarray) -> Lit:
        """The light, with `share` of the plain light replaced by its `known` value, (N, 3)."""
        drawn, pairs = 1 - share, max(self.count * (self.count - 1), 1)
        diffuse = known + self.means[1] + drawn * (self.means[0] - known)
        spread = self.spreads[1] + 2 * drawn * self.common + drawn**2 * self.spreads[0]
        # Where no sample hit the light at all, its shadow is unknown.
        unmet = np.where(self.means[0] > 0, 0, known**2)
        return Lit(
            diffuse, self.means[2], np.maximum(spread, 0) / pairs + unmet, self.spreads[2] / pairs
        )


def _joined(parts: list[_Moments], known: np.ndarray) -> Lit:
    """All parts, each with the share that the other one estimated; a single part takes all light as
    known.
    """
    total, samples = _dark(len(known)), sum(part.count for part in parts)
    for number, part in enumerate(parts):
        share = parts[1 - number].clear_share() if len(parts) == 2 else np.ones((len(known), 1))
        lit, weight = part.lit(known, share), part.count / samples
        means, variances = (
            (lit.shading, lit.specular),
            (lit.shading_variance, lit.specular_variance),
        )
        total = _sum(
            total,
            Lit(
                *(weight * mean for mean in means),
                *(weight**2 * variance for variance in variances),
            ),
        )
    return total


class _Gathered:
    """Running means and spreads of three colours, one lane per point."""

    def __init__(self, lanes: int, seed: int) -> None:
        dr, mi = load_drjit(), load_mitsuba()
        self.random, self.count = generator(lanes, seed), 0
        self.means, self.spreads = (
            [dr.zeros(mi.Color3f, lanes) for _ in range(3)] for _ in range(2)
        )
        self.common = dr.zeros(mi.Color3f, lanes)
        dr.make_opaque(self.means, self.spreads, self.common)

    def add(self, estimate: Callable[[Lanes], tuple[Lanes, ...]], samples: int) -> None:
        """Add samples of the colours that `estimate` computes from random numbers, in one kernel,
        which does not depend on their number.
        """
        dr, mi = load_drjit(), load_mitsuba()
        end = dr.opaque(mi.UInt32, self.count + samples)

        def step(
            k: Lanes, random: Lanes, means: list[Lanes], spreads: list[Lanes], common: Lanes
        ) -> tuple[Lanes, ...]:
            k = k + 1
            values = estimate(random)
            away = [value - mean for value, mean in zip(values, means, strict=True)]
            means = [mean + part / mi.Float(k) for mean, part in zip(means, away, strict=True)]
            left = [value - mean for value, mean in zip(values, means, strict=True)]
            spreads = [spread + a * b for spread, a, b in zip(spreads, away, left, strict=True)]
            return k, random, means, spreads, common + away[0] * left[1]

        state = (
            dr.opaque(mi.UInt32, self.count),
            self.random,
            self.means,
            self.spreads,
            self.common,
        )
        _, self.random, self.means, self.spreads, self.common = dr.while_loop(
            state, lambda k, *_: k < end, step
        )
        dr.eval(self.random, self.means, self.spreads, self.common)
        self.count += samples

    def moments(self, halves: int) -> list[_Moments]:
        """The moments so far, of each half of the lanes."""
        means, spreads = (
            [np.split(rows_of(part), halves) for part in parts]
            for parts in (self.means, self.spreads)
        )
        common = np.split(rows_of(self.common), halves)
        return [
            _Moments(
                self.count, [part[k] for part in means], [part[k] for part in spreads], common[k]
            )
            for k in range(halves)
        ]


def _sum(a: Lit, b: Lit) -> Lit:
    """The sum of lights, and of the variances of independent estimates."""
    return Lit(
        a.shading + b.shading,
        a.specular + b.specular,
        a.shading_variance + b.shading_variance,
        a.specular_variance + b.specular_variance,
    )
