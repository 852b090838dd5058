"""The objective of the light: the prior of reflectance, and a penalty of changes of the light.

Equation: f(x) = g(log D - log S) + r / 2 |x|^2 with S = T E(x) + I, g the smoothness, parsimony and
absolute terms of SIRFS. df/dE = -T' (dg/dA / S).

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.

Limits: the diffuse image is assumed to be exact.
"""

import numpy as np

from isc_core.refinement.reflectance_terms import ReflectanceTerms

from .light_field import LightField


class LightObjective:
    """f as a function for `isc_core.numerics.lbfgs`: ``(x, gradient_out) -> loss``.

    Parameters
    ----------
    terms : ReflectanceTerms
    field : LightField
    transport : (N, J) ndarray
        T.
    indirect : (N, 3) ndarray
        I.
    pixel_weight : (H, W) ndarray
        0 for pixels that are held out.
    strictness : float
        r, > 0.
    """

    def __init__(
        self,
        terms: ReflectanceTerms,
        field: LightField,
        transport: np.ndarray,
        indirect: np.ndarray,
        pixel_weight: np.ndarray,
        strictness: float,
    ) -> None:
        self._terms, self._field, self._strictness = terms, field, strictness
        self._transport, self._indirect = transport, indirect
        self._pixel_weight = pixel_weight

    def __call__(self, x: np.ndarray, gradient: np.ndarray) -> float:
        radiance = self._field.radiance(x)
        shading = shading_of(self._transport, radiance, self._indirect)
        cost, pull = self._terms.cost(shading, self._pixel_weight)
        to_radiance = np.einsum("nj,nc->jc", self._transport, pull)
        gradient[:] = self._field.adjoint(radiance, to_radiance) + self._strictness * x
        return cost + self._strictness / 2 * float(np.square(x).sum())


def shading_of(
    transport: np.ndarray, radiance: np.ndarray, indirect: np.ndarray | float = 0.0
) -> np.ndarray:
    """Return the shading (N, 3) under an environment (J, 3), at least a thousandth of its mean.

    Sums are in a fixed order, so that the same input gives the same bytes on any number of threads.

    Parameters
    ----------
    transport : (N, J) ndarray
    radiance : (J, 3) ndarray
    indirect : (N, 3) ndarray or float
        Added.

    Returns
    -------
    (N, 3) ndarray
    """
    shading = np.einsum("nj,jc->nc", transport, radiance) + indirect
    return np.maximum(shading, 1e-3 * shading.mean())
