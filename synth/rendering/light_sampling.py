"""Random directions toward lights that have a size, and how densely they are drawn.

Problem: the light that a point receives is an integral over the directions in which it sees a
light; samples belong there.

Equation: on a panel points are drawn evenly by area, so that directions have the density r^2 /
(area cos_panel) per steradian. Pixels of an environment are drawn by the light that they hold,
radiance x solid angle, and evenly inside: the density is the radiance's share.

Citation: P. Shirley, C. Wang, K. Zimmerman, "Monte Carlo techniques for direct lighting
calculations", ACM Transactions on Graphics 15(1), 1-36 (1996), doi:10.1145/226150.226151.

Limits: neither knows the surface: half of an environment's samples may lie below a point's horizon.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from isc_core.shading.environment_map import solid_angles

from ..scene.lights import EnvironmentLight, Light, PanelLight


@dataclass(frozen=True)
class Seen:
    """What M rays meet of one light. `radiance`: (M, 3), 0 where they miss it. `distance`: (M,) of
    it, infinite for an environment. `density`: (M,) per steradian, with which `draw` picks each
    direction; 0 where they miss it.
    """

    radiance: np.ndarray
    distance: np.ndarray
    density: np.ndarray


class Sampler(Protocol):
    """A light that has a size, as directions are drawn toward it."""

    def draw(self, rng: np.random.Generator, positions: np.ndarray, count: int) -> np.ndarray:
        """`count` unit directions toward the light from each of the positions (P, 3):

        (P, count, 3).
        """
        ...

    def seen(self, positions: np.ndarray, directions: np.ndarray) -> Seen:
        """What rays from positions (M, 3) along unit directions (M, 3) meet."""
        ...


def sampler_of(light: Light) -> Sampler | None:
    """How directions toward a light are drawn;

    None for lights without a size and for those that do not shine.
    """
    if isinstance(light, PanelLight) and np.any(light.radiance):
        return PanelSampler(light)
    if isinstance(light, EnvironmentLight) and np.any(light.radiance):
        return EnvironmentSampler(light)
    return None


class PanelSampler:
    """Directions toward a panel, even by its area; from behind it nothing is seen."""

    def __init__(self, panel: PanelLight) -> None:
        self._panel = panel

    def draw(self, rng: np.random.Generator, positions: np.ndarray, count: int) -> np.ndarray:
        """See `Sampler`."""
        panel = self._panel
        across, along = rng.uniform(-1, 1, (2, len(positions), count, 1))
        toward = (panel.centre + across * panel.right + along * panel.up) - positions[:, None]
        return toward / np.sqrt(np.einsum("...i,...i->...", toward, toward))[..., None]

    def seen(self, positions: np.ndarray, directions: np.ndarray) -> Seen:
        """See `Sampler`."""
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
    """Directions toward an environment, by the light that its pixels hold (the mean of the
    channels).
    """

    def __init__(self, light: EnvironmentLight) -> None:
        self._radiance = np.asarray(light.radiance, float)
        self._rows = len(self._radiance)
        solid = solid_angles(self._rows)
        power = self._radiance.mean(-1) * solid
        self._density = (power / power.sum() / solid).ravel()
        self._radiance = self._radiance.reshape(-1, 3)
        self._cumulated = np.cumsum(power.ravel() / power.sum())

    def draw(self, rng: np.random.Generator, positions: np.ndarray, count: int) -> np.ndarray:
        """See `Sampler`."""
        chosen, height, across = rng.random((3, len(positions), count))
        pixel = np.searchsorted(self._cumulated, chosen * self._cumulated[-1], side="right")
        row, column = np.divmod(np.minimum(pixel, len(self._cumulated) - 1), 2 * self._rows)
        edges = np.cos(np.arange(self._rows + 1) * np.pi / self._rows)
        up = edges[row] + height * (edges[row + 1] - edges[row])
        turn = (column + across) * (np.pi / self._rows)
        level = np.sqrt(np.maximum(1 - up * up, 0))
        return np.stack([level * np.sin(turn), up, -level * np.cos(turn)], -1)

    def seen(self, positions: np.ndarray, directions: np.ndarray) -> Seen:
        """See `Sampler`."""
        del positions
        scale = self._rows / np.pi
        row = (np.arccos(np.clip(directions[:, 1], -1, 1)) * scale).astype(int)
        column = (np.arctan2(directions[:, 0], -directions[:, 2]) * scale).astype(int)
        # atan2 is negative for the second half of a row, where rounding toward 0 would go the wrong
        # way.
        column = np.where(directions[:, 0] < 0, 2 * self._rows - 1 + column, column)
        pixel = np.minimum(row, self._rows - 1) * 2 * self._rows + np.clip(
            column, 0, 2 * self._rows - 1
        )
        return Seen(self._radiance[pixel], np.full(len(pixel), np.inf), self._density[pixel])
