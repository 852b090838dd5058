"""A positive environment as a smooth change of another one.

Equation: log E_jc = log E0_jc + s sum_k B_jk u_k + t a_c with bumps B_jk ~ exp(k (w_j . p_k - 1)),
p_k evenly over the sphere; u and a are of unit deviation.

Citation: R. A. Fisher 1953, doi:10.1098/rspa.1953.0064 (the bumps).

Limits: bumps are 25 degrees wide: a narrower lamp is blurred.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.shading.environment_map import directions
from isc_core.shading.lights import sphere_directions

_BUMPS, _CONCENTRATION = 40, 6.0
_SPREAD, _TINT = 1.0, 0.1  # standard deviations of log radiance, and of the overall colour


@dataclass(frozen=True, eq=False)
class LightField:
    """Environments near a given one.

    Attributes
    ----------
    log_start : (J, 3) ndarray
        log E0.
    bumps : (J, K) ndarray
        s B.
    """

    log_start: np.ndarray
    bumps: np.ndarray

    @staticmethod
    def around(start: np.ndarray) -> "LightField":
        """Return the environments near a given one.

        Parameters
        ----------
        start : (rows, 2 rows, 3) ndarray
            Radiance, > 0.

        Returns
        -------
        LightField
        """
        towards = directions(len(start)).reshape(-1, 3)
        near = np.einsum("jk,bk->jb", towards, sphere_directions(_BUMPS)) - 1
        bumps = np.exp(_CONCENTRATION * near)
        bumps *= _SPREAD / np.sqrt(np.square(bumps).sum(axis=1).mean())
        return LightField(np.log(start.reshape(-1, 3).astype(float)), bumps)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.bumps.shape[1] + 3

    def radiance(self, unknowns: np.ndarray) -> np.ndarray:
        """Return the environment of some unknowns.

        Parameters
        ----------
        unknowns : (size,) ndarray

        Returns
        -------
        (J, 3) ndarray
        """
        change = np.einsum("jb,b->j", self.bumps, unknowns[:-3])
        return np.exp(self.log_start + change[:, None] + _TINT * unknowns[-3:])

    def adjoint(self, radiance: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """Return the gradient of the unknowns from that of the radiance.

        Parameters
        ----------
        radiance : (J, 3) ndarray
            Of the unknowns.
        gradient : (J, 3) ndarray

        Returns
        -------
        (size,) ndarray
        """
        along = radiance * gradient
        return np.concatenate(
            [np.einsum("jb,j->b", self.bumps, along.sum(axis=1)), _TINT * along.sum(axis=0)]
        )
