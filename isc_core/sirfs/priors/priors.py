"""What SIRFS believes before it sees a photo: statistics of shape, reflectance and illumination.

All are in the convention of the SIRFS reference (Barron & Malik 2015,
doi:10.1109/TPAMI.2014.2377712): lights are 9 coefficients a channel, stacked channel by channel,
for normals in a (down, right, toward the viewer) frame.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...numerics.linear import solve_linear
from .tabulated_potential import TabulatedPotential


@dataclass(frozen=True)
class AbsoluteTable:
    """Cost of a whitened log colour:

    `values` (n, n, n) for colour or (n,) for grey, nodes from `low` to `high` on each axis.
    """

    low: float
    high: float
    values: np.ndarray


@dataclass(frozen=True)
class Light:
    """A Gaussian over the stacked light coefficients l (9 C numbers).

    `mean` and `covariance` are the Gaussian of the light's cost. The solver works in u, with l =
    unwhiten @ u + offset.
    """

    mean: np.ndarray
    covariance: np.ndarray
    unwhiten: np.ndarray
    offset: np.ndarray

    @cached_property
    def precision(self) -> np.ndarray:
        """The inverse covariance, computed once: a library's solver would wake its threads at every
        evaluation.
        """
        inverse = solve_linear(self.covariance, np.eye(len(self.covariance)))
        return (inverse + inverse.T) / 2


@dataclass(frozen=True)
class SilhouetteProfile:
    """How far surfaces have turned away at relative depth u = (k + 0.5) / K behind the silhouette:

    `mean` and `spread`, both (K,).
    """

    mean: np.ndarray
    spread: np.ndarray

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and spread at `u` in [0, 1], linearly interpolated."""
        nodes = (np.arange(len(self.mean)) + 0.5) / len(self.mean)
        return np.interp(u, nodes, self.mean), np.interp(u, nodes, self.spread)


@dataclass(frozen=True)
class Priors:
    """Everything the SIRFS objective needs besides its weights.

    `channels`: 3 (colour) or 1 (grey). `curvature`: cost of the difference x of two mean curvatures
    (1 / pixel), symmetric, 0 at x = 0. `smoothness`: cost of m = 0.5 |smoothness_whiten (A_p -
    A_q)|^2 in colour, of A_p - A_q itself in grey. `parsimony_whiten`: (C, C), takes log
    reflectance to the space of the parsimony and absolute terms. `silhouette`: see `silhouette`;
    None where nothing is known of it.
    """

    channels: int
    curvature: TabulatedPotential
    smoothness: TabulatedPotential
    smoothness_whiten: np.ndarray
    parsimony_whiten: np.ndarray
    absolute: AbsoluteTable
    light: Light
    silhouette: SilhouetteProfile | None = None

    def without_silhouette(self) -> "Priors":
        """The same without the silhouette term, as SIRFS was published."""
        return replace(self, silhouette=None)
