"""Random directions toward extended lights, and their density.

Problem: the light that a point receives is an integral over the solid angle of a light, so samples
should lie there.

Equation: on a panel, points are sampled uniformly by area, so that directions have the density
r^2 / (area cos_panel) per steradian. Pixels of an environment are sampled by their light, radiance
x solid angle, and uniformly inside: the density is proportional to the radiance.

Citation: P. Shirley, C. Wang, K. Zimmerman, "Monte Carlo techniques for direct lighting
calculations", ACM Transactions on Graphics 15(1), 1-36 (1996), doi:10.1145/226150.226151.

Limits: both ignore the surface: half of an environment's samples may lie below a point's horizon.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from isc_core.shading.environment_map import solid_angles

from ..scene.lights import EnvironmentLight, Light, PanelLight


@dataclass(frozen=True, eq=False)
class Seen:
    """Intersections of M rays with one light.

    Attributes
    ----------
    radiance : (M, 3) ndarray
        0 where they miss it.
    distance : (M,) ndarray
        Distance of the light, infinite for an environment.
    density : (M,) ndarray
        Density of `draw` in each direction, per steradian; 0 where they miss it.
    """

    radiance: np.ndarray
    distance: np.ndarray
    density: np.ndarray


class Sampler(Protocol):
    """Sampling of directions toward an extended light."""

    def draw(self, rng: np.random.Generator, positions: np.ndarray, count: int) -> np.ndarray:
        """Draw directions toward the light.

        Parameters
        ----------
        rng : numpy.random.Generator
            Random numbers.
        positions : (P, 3) ndarray
            Where they start.
        count : int
            Directions per position.

        Returns
        -------
        (P, count, 3) ndarray
            Unit directions.
        """
        ...

    def seen(self, positions: np.ndarray, directions: np.ndarray) -> Seen:
        """Return the intersections of rays with the light.

        Parameters
        ----------
        positions, directions : (M, 3) ndarray
            Origins and unit directions.

        Returns
        -------
        Seen
            One entry per ray.
        """
        ...


def sampler_of(light: Light) -> Sampler | None:
    """Return the sampler of a light.

    Parameters
    ----------
    light : Light
        The light.

    Returns
    -------
    Sampler or None
        None for a black light or one without extent.
    """
    if isinstance(light, PanelLight) and np.any(light.radiance):
        return PanelSampler(light)
    if isinstance(light, EnvironmentLight) and np.any(light.radiance):
        return EnvironmentSampler(light)
    return None


class PanelSampler:
    """Directions toward a panel, uniform by its area; its back is dark."""

    def __init__(self, panel: PanelLight) -> None:
        self._panel = panel

    def draw(self, rng: np.random.Generator, positions: np.ndarray, count: int) -> np.ndarray:
        """Draw directions toward the panel; see `Sampler`.

        Parameters
        ----------
        rng : numpy.random.Generator
            Random numbers.
        positions : (P, 3) ndarray
            Where they start.
        count : int
            Directions per position.

        Returns
        -------
        (P, count, 3) ndarray
            Unit directions.
        """
        panel = self._panel
        across, along = rng.uniform(-1, 1, (2, len(positions), count, 1))
        toward = (panel.centre + across * panel.right + along * panel.up) - positions[:, None]
        return toward / np.sqrt(np.einsum("...i,...i->...", toward, toward))[..., None]

    def seen(self, positions: np.ndarray, directions: np.ndarray) -> Seen:
        """Return the intersections of rays with the panel; see `Sampler`.

        Parameters
        ----------
        positions, directions : (M, 3) ndarray
            Origins and unit directions.

        Returns
        -------
        Seen
            One entry per ray.
        """
        panel = self._panel
        slope = -(directions @ panel.normal)
        facing = slope > 1e-9
        distance = ((positions - panel.centre) @ panel.normal) / np.where(facing, slope, 1)
        met = positions + directions * distance[:, None] - panel.centre
        hit = facing & (distance > 0)
        for side in (panel.right, panel.up):
            hit &= np.abs(met @ side) <= side @ side
        density = np.where(hit, distance**2 / (panel.area * np.where(facing, slope, 1)), 0)
        return Seen(hit[:, None] * panel.radiance, distance, density)


class EnvironmentSampler:
    """Directions toward an environment, by the light of its pixels (mean of the channels)."""

    def __init__(self, light: EnvironmentLight) -> None:
        self._radiance = np.asarray(light.radiance, float)
        self._rows = len(self._radiance)
        solid = solid_angles(self._rows)
        power = self._radiance.mean(-1) * solid
        self._density = (power / power.sum() / solid).ravel()
        self._radiance = self._radiance.reshape(-1, 3)
        self._cumulated = np.cumsum(power.ravel() / power.sum())

    def draw(self, rng: np.random.Generator, positions: np.ndarray, count: int) -> np.ndarray:
        """Draw directions toward the environment; see `Sampler`.

        Parameters
        ----------
        rng : numpy.random.Generator
            Random numbers.
        positions : (P, 3) ndarray
            Where they start; only their number matters.
        count : int
            Directions per position.

        Returns
        -------
        (P, count, 3) ndarray
            Unit directions.
        """
        chosen, height, across = rng.random((3, len(positions), count))
        pixel = np.searchsorted(self._cumulated, chosen * self._cumulated[-1], side="right")
        row, column = np.divmod(np.minimum(pixel, len(self._cumulated) - 1), 2 * self._rows)
        edges = np.cos(np.arange(self._rows + 1) * np.pi / self._rows)
        up = edges[row] + height * (edges[row + 1] - edges[row])
        turn = (column + across) * (np.pi / self._rows)
        level = np.sqrt(np.maximum(1 - up * up, 0))
        return np.stack([level * np.sin(turn), up, -level * np.cos(turn)], -1)

    def seen(self, positions: np.ndarray, directions: np.ndarray) -> Seen:
        """Return the intersections of rays with the environment; see `Sampler`.

        Parameters
        ----------
        positions, directions : (M, 3) ndarray
            Origins, which do not matter, and unit directions.

        Returns
        -------
        Seen
            One entry per ray.
        """
        del positions
        scale = self._rows / np.pi
        row = (np.arccos(np.clip(directions[:, 1], -1, 1)) * scale).astype(int)
        column = (np.arctan2(directions[:, 0], -directions[:, 2]) * scale).astype(int)
        # atan2 is negative in the second half of a row, where rounding toward 0 rounds up.
        column = np.where(directions[:, 0] < 0, 2 * self._rows - 1 + column, column)
        pixel = np.minimum(row, self._rows - 1) * 2 * self._rows + np.clip(
            column, 0, 2 * self._rows - 1
        )
        return Seen(self._radiance[pixel], np.full(len(pixel), np.inf), self._density[pixel])
