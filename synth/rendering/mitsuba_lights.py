"""Lights on Mitsuba's arrays: the radiance along a direction, and importance sampling of
directions.

Equation: an environment is constant on each pixel; a pixel is sampled by its light, radiance times
solid angle, and a direction uniformly within it, so the density is share / solid angle. A point on
a panel is sampled uniformly: distance^2 / (area cos) per steradian. Beams (directional and point
lights) are not sampled: they arrive from one direction.

Citation: P. Shirley, C. Wang, K. Zimmerman, "Monte Carlo techniques for direct lighting
calculations", ACM Transactions on Graphics 15(1), 1-36 (1996), doi:10.1145/226150.226151.

Limits: those of `scene.lights`.
"""

import math
from typing import Any, Protocol

import numpy as np

from isc_core.shading.environment_map import solid_angles

from ..scene.lights import DirectionalLight, EnvironmentLight, Light, PanelLight, PointLight
from ..scene.tracing import lanes
from ..scene.variant import load_mitsuba
from .bsdfs import Lanes, load_drjit
from .irradiance import unoccluded_panel, unoccluded_shading

FAR = 1e6  # object units: farther than anything in a scene


class WideLight(Protocol):
    """A light that fills a solid angle."""

    def along(self, position: Lanes, direction: Lanes) -> tuple[Lanes, Lanes, Lanes]:
        """Return the light that arrives along a direction.

        Parameters
        ----------
        position, direction : Dr.Jit point and vector
            Where the light arrives, and the unit direction toward it.

        Returns
        -------
        radiance, distance, density : Dr.Jit colour and arrays
            Radiance, distance of its source, and density of `sample` per steradian.
        """
        ...

    def sample(self, position: Lanes, place: Lanes, inside: Lanes) -> Lanes:
        """Sample a direction toward the light.

        Parameters
        ----------
        position : Dr.Jit point
            Where the light arrives.
        place, inside : Dr.Jit points
            Two uniform random numbers each.

        Returns
        -------
        Dr.Jit vector
            Unit direction.
        """
        ...

    def unoccluded(self, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Return the shading without shadows, in closed form.

        Parameters
        ----------
        position, normal : (N, 3) ndarray
            Points and unit normals.

        Returns
        -------
        (N, 3) ndarray
            Of a white diffuse surface.
        """
        ...


class Environment:
    """An environment that is not black."""

    def __init__(self, light: EnvironmentLight) -> None:
        dr, mi = load_drjit(), load_mitsuba()
        self._radiance = np.asarray(light.radiance, float)
        rows = len(self._radiance)
        solid = solid_angles(rows)
        power = self._radiance.mean(axis=2) * solid
        share = power / power.sum()
        in_row = share.sum(axis=1)
        self.rows = mi.UInt32(rows)
        self.below = lanes(np.cumsum(in_row))
        self.before = lanes(
            (np.cumsum(share, axis=1) / np.maximum(in_row, 1e-300)[:, None]).ravel()
        )
        self.density = lanes((share / solid).ravel())
        self.colours = [lanes(self._radiance[..., channel].ravel()) for channel in range(3)]
        dr.make_opaque(self.rows)

    def along(self, position: Lanes, direction: Lanes) -> tuple[Lanes, Lanes, Lanes]:
        """Return the light that arrives along a direction; see `WideLight`.

        Parameters
        ----------
        position, direction : Dr.Jit point and vector
            Where the light arrives, which does not matter, and the unit direction toward it.

        Returns
        -------
        radiance, distance, density : Dr.Jit colour and arrays
            Radiance, distance (`FAR`), and density of `sample` per steradian.
        """
        dr, mi = load_drjit(), load_mitsuba()
        del position
        rows = mi.Float(self.rows)
        row = mi.UInt32(dr.clip(dr.safe_acos(direction.y) / math.pi * rows, 0, rows - 1))
        turn = dr.atan2(direction.x, -direction.z) / math.pi
        column = mi.UInt32(dr.clip(dr.select(turn < 0, turn + 2, turn) * rows, 0, 2 * rows - 1))
        pixel = row * (2 * self.rows) + column
        radiance = mi.Color3f(*(dr.gather(mi.Float, colour, pixel) for colour in self.colours))
        return radiance, mi.Float(FAR), dr.gather(mi.Float, self.density, pixel)

    def sample(self, position: Lanes, place: Lanes, inside: Lanes) -> Lanes:
        """Sample a direction toward the light; see `WideLight`.

        Parameters
        ----------
        position : Dr.Jit point
            Where the light arrives, which does not matter.
        place, inside : Dr.Jit points
            Two uniform random numbers each: for the pixel, and for the place within it.

        Returns
        -------
        Dr.Jit vector
            Unit direction.
        """
        dr, mi = load_drjit(), load_mitsuba()
        del position
        row = _first_above(self.below, mi.UInt32(0), self.rows, place.x)
        start = row * (2 * self.rows)
        column = _first_above(self.before, start, 2 * self.rows, place.y) - start
        step = math.pi / mi.Float(self.rows)
        # Uniform in the cosine of the polar angle is uniform in solid angle.
        upper, lower = (dr.cos((mi.Float(row) + k) * step) for k in (0, 1))
        up = dr.lerp(upper, lower, inside.x)
        sine, cosine = dr.sincos((mi.Float(column) + inside.y) * step)
        across = dr.safe_sqrt(1 - up * up)
        return mi.Vector3f(across * sine, up, -across * cosine)

    def unoccluded(self, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Return the shading without shadows, in closed form; see `WideLight`.

        Parameters
        ----------
        position, normal : (N, 3) ndarray
            Points, which do not matter, and unit normals.

        Returns
        -------
        (N, 3) ndarray
            Of a white diffuse surface.
        """
        del position
        return unoccluded_shading(self._radiance, normal)


class Panel:
    """A panel light."""

    def __init__(self, light: PanelLight) -> None:
        dr, mi = load_drjit(), load_mitsuba()
        self._light = light
        vectors = (light.centre, light.right, light.up, light.normal)
        self.centre, self.right, self.up, self.normal = (
            mi.Vector3f(*np.asarray(vector, float).tolist()) for vector in vectors
        )
        self.radiance, self.area = (
            mi.Color3f(*np.asarray(light.radiance, float).tolist()),
            mi.Float(light.area),
        )
        dr.make_opaque(self.centre, self.right, self.up, self.normal, self.radiance, self.area)

    def along(self, position: Lanes, direction: Lanes) -> tuple[Lanes, Lanes, Lanes]:
        """Return the light that arrives along a direction; see `WideLight`.

        Parameters
        ----------
        position, direction : Dr.Jit point and vector
            Where the light arrives, and the unit direction toward it.

        Returns
        -------
        radiance, distance, density : Dr.Jit colour and arrays
            Radiance, distance of the panel's plane, and density of `sample` per steradian; radiance
            and density are 0 where the direction misses the panel or meets its back.
        """
        dr = load_drjit()
        toward, facing = self.centre - position, -dr.dot(direction, self.normal)
        distance = -dr.dot(toward, self.normal) / dr.select(facing > 1e-9, facing, 1)
        met = direction * distance - toward
        inside = (facing > 1e-9) & (distance > 0)
        for side in (self.right, self.up):
            inside &= dr.abs(dr.dot(met, side)) <= dr.squared_norm(side) * (1 + 1e-5)
        density = dr.select(inside, distance * distance / (self.area * dr.maximum(facing, 1e-9)), 0)
        return dr.select(inside, self.radiance, 0), distance, density

    def sample(self, position: Lanes, place: Lanes, inside: Lanes) -> Lanes:
        """Sample a direction toward the light; see `WideLight`.

        Parameters
        ----------
        position : Dr.Jit point
            Where the light arrives.
        place, inside : Dr.Jit points
            Two uniform random numbers each; `inside` is not used.

        Returns
        -------
        Dr.Jit vector
            Unit direction.
        """
        dr = load_drjit()
        del inside
        return dr.normalize(
            self.centre + (2 * place.x - 1) * self.right + (2 * place.y - 1) * self.up - position
        )

    def unoccluded(self, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Return the shading without shadows, in closed form; see `WideLight`.

        Parameters
        ----------
        position, normal : (N, 3) ndarray
            Points and unit normals.

        Returns
        -------
        (N, 3) ndarray
            Of a white diffuse surface.
        """
        return unoccluded_panel(self._light, position, normal)


class Beam:
    """A directional or point light."""

    def __init__(self, light: DirectionalLight | PointLight) -> None:
        dr, mi = load_drjit(), load_mitsuba()
        self.near = isinstance(light, PointLight)
        place, strength = (
            (light.position, light.intensity)
            if isinstance(light, PointLight)
            else (light.direction, light.irradiance)
        )
        self.place, self.strength = (
            mi.Vector3f(*np.asarray(place, float).tolist()),
            mi.Color3f(*np.asarray(strength, float).tolist()),
        )
        dr.make_opaque(self.place, self.strength)

    def arriving(self, position: Lanes) -> tuple[Lanes, Lanes, Lanes]:
        """Return the light that arrives at a point.

        Parameters
        ----------
        position : Dr.Jit point
            Where the light arrives.

        Returns
        -------
        direction, distance, irradiance : Dr.Jit vector, array and colour
            Unit direction toward the light, its distance (`FAR` for a directional light), and the
            irradiance across its beam.
        """
        dr, mi = load_drjit(), load_mitsuba()
        if not self.near:
            return self.place, mi.Float(FAR), self.strength
        toward = self.place - position
        square = dr.squared_norm(toward)
        distance = dr.sqrt(square)
        return toward / distance, distance, self.strength / square


def kernel_light(light: Light) -> Any:
    """Convert a light to Mitsuba's arrays.

    Parameters
    ----------
    light : Light
        The light.

    Returns
    -------
    WideLight, Beam or None
        None for a black environment.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    if isinstance(light, EnvironmentLight):
        return Environment(light) if np.any(light.radiance) else None
    return Panel(light) if isinstance(light, PanelLight) else Beam(light)


def _first_above(heap: Lanes, start: Lanes, count: Lanes, value: Lanes) -> Lanes:
    """The first index of [start, start + count) whose entry in `heap`, ascending there, is above
    `value`; the last one without any.
    """
    dr, mi = load_drjit(), load_mitsuba()

    def halve(low: Lanes, high: Lanes) -> tuple[Lanes, Lanes]:
        middle = (low + high) // 2
        above = dr.gather(mi.Float, heap, middle) > value
        return dr.select(above, low, middle + 1), dr.select(above, middle, high)

    low, _ = dr.while_loop(
        (start + 0 * mi.UInt32(value), start + count - 1 + 0 * mi.UInt32(value)),
        lambda low, high: low < high,
        halve,
    )
    return low
