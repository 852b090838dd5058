"""One sample of direct light on points, the lobes separate, on Mitsuba's arrays.

Equation: see `mitsuba_lobes`.

Citation: E. Veach, L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo
rendering", SIGGRAPH 1995, doi:10.1145/218380.218498.

Limits: lights do not hide each other.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..scene.tracing import LIFT, Tracer, lanes
from ..scene.variant import load_mitsuba
from .bsdfs import Lanes, Lobes, load_drjit
from .mitsuba_lights import Beam, WideLight


@dataclass(frozen=True)
class Points:
    """Points to be lit, one lane each.

    Attributes
    ----------
    position, origin : Dr.Jit point
        The position, and the same lifted off the surface, where rays start.
    frame : Dr.Jit frame
        z along the normal.
    view : Dr.Jit vector
        Direction to the camera in that frame.
    lobes : Lobes
        The material.
    """

    position: Lanes
    origin: Lanes
    frame: Lanes
    view: Lanes
    lobes: Lobes

    def values(self, direction: Lanes) -> tuple[Lanes, Lanes]:
        """Evaluate both lobes for light from a direction.

        Parameters
        ----------
        direction : Dr.Jit vector
            Unit direction to the light, camera frame.

        Returns
        -------
        diffuse, specular : Dr.Jit array
            f_r cos_light of each lobe; 0 below the horizon.
        """
        return self.lobes.values(self.view, self.frame.to_local(direction))


def points_at(position: np.ndarray, normal: np.ndarray, view: np.ndarray, lobes: Lobes) -> Points:
    """Return points from arrays (N, 3) in the camera frame.

    Parameters
    ----------
    position, normal, view : (N, 3) ndarray
        Positions, unit normals and unit directions to the camera.
    lobes : Lobes
        The material.

    Returns
    -------
    Points
        One lane per point.
    """
    dr, mi = load_drjit(), load_mitsuba()
    place, across, toward = (
        mi.Vector3f(*(lanes(column) for column in part.T)) for part in (position, normal, view)
    )
    frame, origin = mi.Frame3f(across), place + LIFT * across
    local = frame.to_local(toward)
    dr.eval(place, origin, frame, local)
    return Points(mi.Point3f(place), mi.Point3f(origin), frame, local, lobes)


def _visible(
    points: Points, direction: Lanes, distance: Lanes, needed: Lanes, tracer: Tracer
) -> Lanes:
    """Whether nothing blocks the points within `distance`; tested only where `needed`."""
    mi = load_mitsuba()
    ray = mi.Ray3f(points.origin, direction)
    ray.maxt = mi.Float(distance)
    return needed & ~tracer.scene.ray_test(ray, needed)


def beam_light(points: Points, light: Beam, tracer: Tracer) -> tuple[Lanes, Lanes]:
    """Return the light of a directional or point light on both lobes, without noise.

    Parameters
    ----------
    points : Points
        The points.
    light : Beam
        The light.
    tracer : Tracer
        The object.

    Returns
    -------
    diffuse, specular : Dr.Jit colour
        The radiance of both lobes.
    """
    dr = load_drjit()
    direction, distance, irradiance = light.arriving(points.position)
    diffuse, gloss = points.values(direction)
    seen = _visible(points, direction, distance, diffuse > 0, tracer)
    return dr.select(seen, diffuse * irradiance, 0), dr.select(seen, gloss * irradiance, 0)


def generator(lanes: int, seed: int) -> Lanes:
    """Return random numbers for many lanes.

    Parameters
    ----------
    lanes : int
        Number of lanes.
    seed : int
        Common seed, below 2^32.

    Returns
    -------
    Dr.Jit generator
        One stream per lane.
    """
    dr, mi = load_drjit(), load_mitsuba()
    random = mi.PCG32(lanes)
    first, second = mi.sample_tea_32(dr.opaque(mi.UInt32, seed), dr.arange(mi.UInt32, lanes))
    random.seed(mi.UInt64(first), mi.UInt64(second))
    dr.eval(random)
    return random


def one_sample(
    points: Points, light: WideLight, tracer: Tracer, random: Lanes, flat: Lanes
) -> tuple[Lanes, Lanes, Lanes]:
    """Take one sample of an extended light.

    Parameters
    ----------
    points : Points
        The points.
    light : WideLight
        The light.
    tracer : Tracer
        The object.
    random : Dr.Jit generator
        Random numbers.
    flat : Dr.Jit array
        The albedo of a Lambertian surface as control variate.

    Returns
    -------
    plain : Dr.Jit colour
        Radiance of that Lambertian surface without shadows.
    more : Dr.Jit colour
        Difference of the diffuse lobe from it.
    specular : Dr.Jit colour
        Radiance of the specular lobe.
    """
    dr, mi = load_drjit(), load_mitsuba()

    def draw() -> Lanes:
        return mi.Point2f(random.next_float32(), random.next_float32())

    toward = light.sample(points.position, draw(), draw())
    mirrored = points.frame.to_world(
        points.lobes.sample(points.view, random.next_float32(), draw())
    )
    plain, more, gloss = mi.Color3f(0), mi.Color3f(0), mi.Color3f(0)
    for direction in (toward, mirrored):
        local = points.frame.to_local(direction)
        radiance, distance, density = light.along(points.position, direction)
        density += points.lobes.density(points.view, local)
        useful = (local.z > 0) & (density > 0)
        radiance = dr.select(useful, radiance / dr.select(useful, density, 1), 0)
        diffuse_part, specular_part = points.lobes.values(points.view, local)
        seen = _visible(points, direction, distance, useful & (dr.max(radiance) > 0), tracer)
        even = flat * local.z / math.pi
        plain += radiance * even
        more += radiance * (dr.select(seen, diffuse_part, 0) - even)
        gloss += radiance * dr.select(seen, specular_part, 0)
    return plain, more, gloss
