"""SIRFS' priors on shape: smooth mean curvature, isotropic normals, outward normals on the contour.

Equation: with heights Z in pixels, first derivatives Zi (down) and Zj (right) and second ones Zii,
Zjj, Zij:
  mean curvature K = [(1 + Zi^2) Zjj - 2 Zi Zj Zij + (1 + Zj^2) Zii] / (2 (1 + Zi^2 + Zj^2)^1.5)
  curvature   w/(25 n) * sum over pairs of C(sqrt((K_p - K_q)^2 + 1e-8)),
  slant       w/n * sum sqrt((log N3)^2 + 0.01^2),
  contour     60 w/n * sum over contour points of max(0, 1 - N . c)^power.

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.

Limits: orthographic, one smooth surface, no holes.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..scene.known_inputs import DepthObservation
from ..shading.occluding_contour import Contour
from ..shading.surface_stencils import DERIVATIVES, derivative, derivative_adjoint
from .priors.tabulated_potential import TabulatedPotential
from .problem import PAIR_OFFSETS

SOFT_DIFFERENCE = 1e-8
SLANT_SOFTNESS = 0.01
CONTOUR_FACTOR = 60.0
# The gradient of the contour term is 0 where 1 - |N . c| is smaller.
CONTOUR_CLOSE = 1e-3


@dataclass(frozen=True, eq=False)
class Geometry:
    """Local geometry of a height map, each (H, W).

    Attributes
    ----------
    zi, zj : ndarray
        First derivatives, down and right.
    zii, zjj, zij : ndarray
        Second derivatives.
    n1, n2, n3 : ndarray
        Unit normal (down, right, toward the viewer).
    curvature : ndarray
        Mean curvature, 1 / pixel.
    """

    zi: np.ndarray
    zj: np.ndarray
    zii: np.ndarray
    zjj: np.ndarray
    zij: np.ndarray
    n1: np.ndarray
    n2: np.ndarray
    n3: np.ndarray
    curvature: np.ndarray


def geometry(height: np.ndarray, dtype: npt.DTypeLike = None) -> Geometry:
    """Compute the local geometry of a height map.

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.
    dtype : dtype, optional
        Type of the result, by default that of `height`. Differences of heights are always taken in
        the type of `height`.

    Returns
    -------
    Geometry
    """
    padded = np.pad(height, 1, mode="edge")
    zi, zj, zii, zjj, zij = (
        derivative(padded, s).astype(dtype or height.dtype, copy=False) for s in DERIVATIVES
    )
    zi2, zj2 = zi * zi, zj * zj
    n3 = 1 / np.sqrt(1 + zi2 + zj2)
    curvature = ((1 + zi2) * zjj - 2 * zi * zj * zij + (1 + zj2) * zii) * (n3 * n3 * n3) / 2
    return Geometry(zi, zj, zii, zjj, zij, -zi * n3, -zj * n3, n3, curvature)


def height_gradient(
    g: Geometry, d1: np.ndarray, d2: np.ndarray, d3: np.ndarray, dk: np.ndarray
) -> np.ndarray:
    """Compute the gradient of the height from those of the normal and the curvature.

    Parameters
    ----------
    g : Geometry
    d1, d2, d3 : (H, W) ndarray
        Gradients with respect to the normal's components.
    dk : (H, W) ndarray
        Gradient with respect to the mean curvature.

    Returns
    -------
    (H, W) ndarray
    """
    n3, n3cubed = g.n3, g.n3**3
    along = g.zi * d1 + g.zj * d2 - d3
    cut = 3 * g.curvature * n3 * n3 * dk
    half = n3cubed * dk / 2
    di = -n3 * d1 + g.zi * along * n3cubed + 2 * half * (g.zi * g.zjj - g.zj * g.zij) - cut * g.zi
    dj = -n3 * d2 + g.zj * along * n3cubed + 2 * half * (g.zj * g.zii - g.zi * g.zij) - cut * g.zj
    dii, djj, dij = half * (1 + g.zj * g.zj), half * (1 + g.zi * g.zi), -2 * half * g.zi * g.zj
    total = np.zeros_like(n3)
    for stencil, d in zip(DERIVATIVES, (di, dj, dii, djj, dij), strict=True):
        total += derivative_adjoint(d, stencil)
    return total


def pair_slices(down: int, right: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the index pairs that select p and q of all pairs with q = p + (down, right).

    Parameters
    ----------
    down : int
        At least 0.
    right : int

    Returns
    -------
    p, q : tuple of slice
    """
    a, b = max(right, 0), max(-right, 0)
    rows_p, rows_q = slice(None, -down or None), slice(down, None)
    return (rows_p, slice(b, -a or None)), (rows_q, slice(a, -b or None))


def curvature_cost(
    curvature: np.ndarray, valid: np.ndarray, table: TabulatedPotential, weight: float
) -> tuple[float, np.ndarray]:
    """Compute the curvature term over pairs of valid pixels.

    Parameters
    ----------
    curvature : (H, W) ndarray
        Mean curvature, 1 / pixel.
    valid : (H, W) bool ndarray
    table : TabulatedPotential
    weight : float

    Returns
    -------
    cost : float
    gradient : (H, W) ndarray
        With respect to `curvature`.
    """
    gradient = np.zeros_like(curvature)
    total = 0.0
    for offset in PAIR_OFFSETS:
        p, q = pair_slices(*offset)
        both = valid[p] & valid[q]
        difference = curvature[p][both] - curvature[q][both]
        x = np.sqrt(difference * difference + curvature.dtype.type(SOFT_DIFFERENCE))
        cost, slope = table.evaluate(x)
        total += float(cost.sum(dtype=float))
        pair_gradient = slope * difference / x
        gradient[p][both] += pair_gradient
        gradient[q][both] -= pair_gradient
    scale = weight / (25 * curvature.size)
    return scale * total, gradient * curvature.dtype.type(scale)


def slant_cost(n3: np.ndarray, weight: float) -> tuple[float, np.ndarray]:
    """Compute the slant term.

    Parameters
    ----------
    n3 : (H, W) ndarray
        Component of the normal toward the viewer.
    weight : float

    Returns
    -------
    cost : float
    gradient : (H, W) ndarray
        With respect to `n3`.
    """
    x = -np.log(n3)
    soft = np.sqrt(x * x + SLANT_SOFTNESS**2)
    scale = n3.dtype.type(weight / n3.size)
    return float(soft.sum(dtype=float)) * float(weight / n3.size), -scale * x / (soft * n3)


def contour_cost(
    n1: np.ndarray, n2: np.ndarray, contour: Contour, weight: float, power: float, pixels: int
) -> tuple[float, np.ndarray, np.ndarray]:
    """Compute the contour term.

    Parameters
    ----------
    n1, n2 : (H, W) ndarray
        Components of the normal, down and right.
    contour : Contour
    weight, power : float
    pixels : int
        Number of pixels n of the image.

    Returns
    -------
    cost : float
    gradient_n1, gradient_n2 : (P,) ndarray
        At the contour points only.
    """
    at = (contour.rows, contour.columns)
    x = n1[at].astype(float) * contour.down + n2[at].astype(float) * contour.right
    gap = np.maximum(0.0, 1 - x)
    scale = CONTOUR_FACTOR * weight / pixels
    slope = np.where(
        np.abs(x) < 1 - CONTOUR_CLOSE,
        -scale * power * np.maximum(gap, CONTOUR_CLOSE) ** (power - 1),
        0.0,
    )
    return scale * float(np.sum(gap**power)), slope * contour.down, slope * contour.right


def observation_cost(height: np.ndarray, observed: DepthObservation) -> tuple[float, np.ndarray]:
    """Compute the depth term, weight/n_known * sum of (sqrt(1 + (difference/sigma)^2) - 1).

    Parameters
    ----------
    height : (H, W) ndarray
        Pixels toward the viewer.
    observed : DepthObservation

    Returns
    -------
    cost : float
    gradient : (H, W) ndarray
    """
    known = np.isfinite(observed.height)
    count = max(int(known.sum()), 1)
    r = (
        np.where(known, height.astype(float) - np.where(known, observed.height, 0), 0)
        / observed.sigma
    )
    root = np.sqrt(1 + r * r)
    scale = observed.weight / count
    return scale * float((root - 1).sum()), (scale / observed.sigma) * r / root
