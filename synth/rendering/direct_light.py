"""Direct light on points of a surface, the two lobes of the material separate.

Problem: radiance toward the camera is, for each lobe f, the integral of f V L cos over the
directions w to a light L, with V = 0 where the object itself blocks the light.

Equation: point and directional lights are one direction each, without noise. For panels and
environments each sample takes one direction toward the light and one from the specular lobe
(diffuse materials: by the cosine); with n_k directions of density p_k each adds

    f V L cos / sum_k n_k p_k          (the balance heuristic)

Of the diffuse lobe only the shadows are estimated: a times the closed form S without shadows, for a
surface that reflects a constant b, plus (V f - a b) L cos / .... b is f for light along the normal;
a is the unshadowed share of the light, for each half of the samples as estimated by the other half,
which keeps the mean unbiased. So a convex diffuse object has no noise, and neither has full shadow.

Citation: E. Veach, L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo
rendering", SIGGRAPH 1995, doi:10.1145/218380.218498; control variates: J. M. Hammersley, D. C.
Handscomb, "Monte Carlo methods" (1964), doi:10.1007/978-94-009-5819-7.

Limits: panels hide neither each other nor the environment. The variance is estimated from the
samples themselves: if no sample hit a rare light, the variance is 0, which is wrong.
"""

from dataclasses import dataclass

import numpy as np

from ..scene.lights import DirectionalLight, EnvironmentLight, Light, PanelLight, PointLight
from ..scene.tracing import Tracer
from .irradiance import unoccluded_panel, unoccluded_shading
from .light_sampling import Sampler
from .reflection import Points, Reflection

_ENOUGH = 4  # fewest samples for a variance in either half


class Sums:
    """Accumulated lobes of N points, (N, 3) each, and the variances of both."""

    def __init__(self, count: int) -> None:
        self.diffuse, self.gloss, self.diffuse_variance, self.gloss_variance = np.zeros(
            (4, count, 3)
        )

    def add(
        self,
        chunk: slice,
        paths: "Paths",
        clear: np.ndarray,
        unshadowed: "Unshadowed | None" = None,
    ) -> None:
        """Add the samples of a chunk of points.

        Parameters
        ----------
        chunk : slice
            The points.
        paths : Paths
            Their samples.
        clear : (M,) ndarray of bool
            Which samples reach their light.
        unshadowed : Unshadowed, optional
            The diffuse lobe of the chunk's points without shadows.
        """
        count = chunk.stop - chunk.start
        diffuse, gloss = clear * paths.diffuse, clear * paths.gloss
        halves = min(paths.samples) >= _ENOUGH
        group = 2 * paths.strategy + paths.half if halves else paths.strategy
        sizes = (
            [(many + 1 - half) // 2 for many in paths.samples for half in (0, 1)]
            if halves
            else list(paths.samples)
        )
        if unshadowed is not None:
            share = _clear_share(paths, clear, count)[::-1] if halves else np.ones((2, count))
            first = sizes[0] / paths.samples[0]
            self.diffuse[chunk] += (first * share[0] + (1 - first) * share[1])[
                :, None
            ] * unshadowed.diffuse
            diffuse = diffuse - unshadowed.reflected[paths.point] * share[paths.half, paths.point]
        cell = group * count + paths.point
        for lobe, mean, noise in (
            (diffuse, self.diffuse, self.diffuse_variance),
            (gloss, self.gloss, self.gloss_variance),
        ):
            for channel in range(3):
                total, variance = _sum_and_variance(
                    lobe * paths.light[:, channel], cell, count, sizes
                )
                mean[chunk, channel] += total
                noise[chunk, channel] += variance


@dataclass(frozen=True, eq=False)
class Paths:
    """M samples that carry light unless they are blocked.

    Attributes
    ----------
    point : (M,) ndarray of int
        Index of the point in the chunk.
    strategy : (M,) ndarray of int
        0 or 1: by light or by lobe.
    half : (M,) ndarray of int
        0 or 1: which half of the samples.
    samples : (int, int)
        Samples of each strategy per point.
    direction : (M, 3) ndarray
        Unit directions.
    reach : (M,) ndarray
        Distance of the light.
    light : (M, 3) ndarray
        L cos / sum n p.
    diffuse, gloss : (M,) ndarray
        f of the diffuse and the specular lobe.
    """

    point: np.ndarray
    strategy: np.ndarray
    half: np.ndarray
    samples: tuple[int, int]
    direction: np.ndarray
    reach: np.ndarray
    light: np.ndarray
    diffuse: np.ndarray
    gloss: np.ndarray


def draw_paths(
    rng: np.random.Generator,
    points: Points,
    reflection: Reflection,
    sampler: Sampler,
    samples: tuple[int, int],
) -> Paths:
    """Sample an extended light.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    points : Points
        Where light arrives.
    reflection : Reflection
        The material without its albedo.
    sampler : Sampler
        Of the light.
    samples : (int, int)
        Directions per point, toward the light and by the lobe.

    Returns
    -------
    Paths
        The samples.
    """
    to_light = sampler.draw(rng, points.position, samples[0])
    by_lobe = reflection.draw(rng, points, samples[1])
    direction = np.concatenate([to_light, by_lobe], axis=1)
    cosine = np.einsum("nsi,ni->ns", direction, points.normal)
    point, sample = np.nonzero(cosine > 1e-9)
    seen = sampler.seen(points.position[point], direction[point, sample])
    bright = seen.radiance.any(axis=1)
    point, sample = point[bright], sample[bright]
    direction, many = direction[point, sample], points.at(point)
    density = samples[0] * seen.density[bright] + samples[1] * reflection.density(many, direction)
    return Paths(
        point=point,
        strategy=(sample >= samples[0]).astype(int),
        half=(sample - np.where(sample >= samples[0], samples[0], 0)) % 2,
        samples=samples,
        direction=direction,
        reach=seen.distance[bright],
        light=seen.radiance[bright] * (cosine[point, sample] / density)[:, None],
        diffuse=reflection.diffuse(many, direction),
        gloss=reflection.gloss(many, direction),
    )


def trace_paths(points: Points, paths: Paths, tracer: Tracer) -> np.ndarray:
    """Test which samples reach their light.

    Parameters
    ----------
    points : Points
        The points.
    paths : Paths
        Their samples.
    tracer : Tracer
        The object.

    Returns
    -------
    (M,) ndarray of bool
        One entry per sample.
    """
    return ~tracer.blocked(points.lifted()[paths.point], paths.direction, paths.reach)


@dataclass(frozen=True, eq=False)
class Unshadowed:
    """The diffuse lobe of N points without shadows, in closed form.

    Attributes
    ----------
    reflected : (N,) ndarray
        A constant f that approximates the diffuse lobe.
    diffuse : (N, 3) ndarray
        Radiance under one light of a surface that reflects so.
    """

    reflected: np.ndarray
    diffuse: np.ndarray

    def at(self, chosen: slice) -> "Unshadowed":
        """Return the values of some of the points.

        Parameters
        ----------
        chosen : slice
            The points.

        Returns
        -------
        Unshadowed
            One entry per chosen point.
        """
        return Unshadowed(self.reflected[chosen], self.diffuse[chosen])


def unshadowed(
    points: Points, reflection: Reflection, light: PanelLight | EnvironmentLight
) -> Unshadowed:
    """Return the diffuse lobe under one extended light as if the object cast no shadow.

    Parameters
    ----------
    points : Points
        The points.
    reflection : Reflection
        The material without its albedo.
    light : PanelLight or EnvironmentLight
        The light.

    Returns
    -------
    Unshadowed
        The diffuse lobe.
    """
    reflected = reflection.diffuse(points, points.normal)
    if isinstance(light, EnvironmentLight):
        shading = unoccluded_shading(light.radiance, points.normal)
    else:
        shading = unoccluded_panel(light, points.position, points.normal)
    return Unshadowed(reflected, np.pi * reflected[:, None] * shading)


def _clear_share(paths: Paths, clear: np.ndarray, count: int) -> np.ndarray:
    """Share of the light that reaches each point, (2, count), as estimated by either half of the
    samples; 1 without samples.
    """
    cell, light = paths.half * count + paths.point, paths.light.sum(1)
    reached, all_of_it = (
        np.bincount(cell, weight, 2 * count).reshape(2, count) for weight in (clear * light, light)
    )
    return np.where(all_of_it > 0, reached / np.where(all_of_it > 0, all_of_it, 1), 1)


def _sum_and_variance(
    values: np.ndarray, cell: np.ndarray, count: int, sizes: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Sums (count,) of samples over groups of equal distribution, and their variances.

    `cell`: group * count + point; `sizes`: samples of each group per point; those without light
    need not be listed.
    """
    sums, squares = (
        np.bincount(cell, values**power, len(sizes) * count).reshape(len(sizes), count)
        for power in (1, 2)
    )
    many = np.array(sizes, float)[:, None]
    spread = np.maximum(squares - sums**2 / many, 0) * many / np.maximum(many - 1, 1)
    return sums.sum(0), spread.sum(0)


def add_exactly(
    total: Sums, points: Points, reflection: Reflection, light: Light, tracer: Tracer
) -> None:
    """Add a light without extent: one direction and one ray per point, no noise.

    Parameters
    ----------
    total : Sums
        Receives the light.
    points : Points
        The points.
    reflection : Reflection
        The material without its albedo.
    light : Light
        Only point and directional lights are added.
    tracer : Tracer
        The object.
    """
    if isinstance(light, DirectionalLight):
        toward, reach = (
            np.broadcast_to(np.asarray(light.direction, float), points.position.shape),
            np.full(len(points), np.inf),
        )
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
    lit = lit[~tracer.blocked(points.at(lit).lifted(), toward[lit], reach[lit])]
    some, arriving = points.at(lit), beam[lit] * cosine[lit, None]
    total.diffuse[lit] += reflection.diffuse(some, toward[lit])[:, None] * arriving
    total.gloss[lit] += reflection.gloss(some, toward[lit])[:, None] * arriving
