"""The priors as the SIRFS solver reads them: statistics of shape, reflectance and illumination.

All are in the convention of the SIRFS reference (J. T. Barron, J. Malik 2015,
doi:10.1109/TPAMI.2014.2377712): lights are 9 coefficients a channel, stacked channel by channel,
for normals in a (down, right, toward the viewer) frame.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...numerics.linear import solve_linear
from .tabulated_potential import TabulatedPotential


@dataclass(frozen=True, eq=False)
class AbsoluteTable:
    """Cost of a whitened log colour, on a uniform grid.

    Attributes
    ----------
    low, high : float
        First and last node on each axis.
    values : (n, n, n) or (n,) ndarray
        For colour or grey.
    """

    low: float
    high: float
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class LightPrior:
    """A Gaussian over the stacked light coefficients l (9 C numbers).

    The solver works in u, with l = unwhiten @ u + offset.

    Attributes
    ----------
    mean : (9 C,) ndarray
    covariance : (9 C, 9 C) ndarray
    unwhiten : (9 C, 9 C) ndarray
    offset : (9 C,) ndarray
    """

    mean: np.ndarray
    covariance: np.ndarray
    unwhiten: np.ndarray
    offset: np.ndarray

    @cached_property
    def precision(self) -> np.ndarray:
        """Inverse covariance, computed once.

        Without LAPACK, whose threads would be started at every evaluation.
        """
        inverse = solve_linear(self.covariance, np.eye(len(self.covariance)))
        return (inverse + inverse.T) / 2


@dataclass(frozen=True, eq=False)
class SilhouetteProfile:
    """Outward in-plane part of normals at relative depth u = (k + 0.5) / K from the silhouette.

    Attributes
    ----------
    mean, spread : (K,) ndarray
        Its mean and standard deviation.
    """

    mean: np.ndarray
    spread: np.ndarray

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and spread at a relative depth, linearly interpolated.

        Parameters
        ----------
        u : ndarray
            In [0, 1].

        Returns
        -------
        tuple of ndarray
            Mean and spread, each of the shape of `u`.
        """
        nodes = (np.arange(len(self.mean)) + 0.5) / len(self.mean)
        return np.interp(u, nodes, self.mean), np.interp(u, nodes, self.spread)


@dataclass(frozen=True, eq=False)
class Priors:
    """Everything the SIRFS objective needs besides its weights.

    Attributes
    ----------
    channels : int
        3 (colour) or 1 (grey).
    curvature : TabulatedPotential
        Cost of the difference x of two mean curvatures (1 / pixel), symmetric, 0 at x = 0.
    smoothness : TabulatedPotential
        Cost of m = 0.5 |smoothness_whiten (A_p - A_q)|^2 in colour, of A_p - A_q itself in grey.
    smoothness_whiten : (C, C) ndarray
    parsimony_whiten : (C, C) ndarray
        Transforms log reflectance to the space of the parsimony and absolute terms.
    absolute : AbsoluteTable
    light : LightPrior
    silhouette : SilhouetteProfile or None
        See `silhouette`; None to omit its term.
    """

    channels: int
    curvature: TabulatedPotential
    smoothness: TabulatedPotential
    smoothness_whiten: np.ndarray
    parsimony_whiten: np.ndarray
    absolute: AbsoluteTable
    light: LightPrior
    silhouette: SilhouetteProfile | None = None

    def without_silhouette(self) -> "Priors":
        """Return the priors without the silhouette term, as SIRFS was published."""
        return replace(self, silhouette=None)
