"""A prior of the normals from the silhouette: near it, surfaces are slanted outward; far from it,
they face the viewer.

Problem: the term of the occluding contour constrains the silhouette only, and inside it convex and
concave shapes are equally likely. This term extends the constraint inward.

Equation: for a pixel at distance d from the silhouette, u = d / max d, let c be the outward
direction (minus the gradient of the smoothed distance) and t = (N1, N2) the normal's part in the
image plane. Over real objects t has mean m(u) c and a spread s(u) of each component:
  cost = w/n_v * sum over valid pixels of |t - m(u) c|^2 / (2 s(u)^2).
The profile m, s is fitted to objects of known shape (`prior_fitting`). The solver starts at the
dome whose normals are the means.

Citation: ours; in the spirit of inflation from contours (D. Terzopoulos, A. Witkin, M. Kass 1988,
doi:10.1016/0004-3702(88)90080-X).

Limits: one object, wholly inside the frame; hollow shapes violate the prior.
"""

from dataclasses import dataclass

import numpy as np

from ..filters.distance import distance_to
from ..filters.gaussian import gaussian_average
from ..imaging.channels import length
from ..imaging.row_blocks import row_blocks
from .precision import scaled_precision
from .priors.priors import SilhouetteProfile

_STEPS = 257
_MAX_IN_PLANE = 0.99  # largest in-plane part of a normal
# Fraction of the largest distance: the outward direction ignores finer detail of the silhouette.
_SMOOTHING = 0.05


@dataclass(frozen=True, eq=False)
class ExpectedNormals:
    """Expected normals, each (H, W); 0 outside the mask.

    Attributes
    ----------
    down, right : ndarray
        Expected in-plane part of the unit normal.
    precision : ndarray
        1 / s^2 of each component.
    """

    down: np.ndarray
    right: np.ndarray
    precision: np.ndarray


@dataclass(frozen=True, eq=False)
class SilhouetteNormals(ExpectedNormals):
    """Normals expected from a silhouette, and the height map that they integrate to.

    Attributes
    ----------
    dome : (H, W) ndarray
        Height in pixels. With a slope of m / sqrt(1 - m^2) at depth u,
        Z(d) = d_max integral_0^u m / sqrt(1 - m^2) du.
    """

    dome: np.ndarray


def silhouette_coordinates(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute the relative depth and the outward direction of every pixel.

    A mask that reaches the border of the image is assumed to continue beyond it; its border there
    is no silhouette. In a mask without any silhouette, u = 1 everywhere.

    Parameters
    ----------
    mask : (H, W) bool ndarray

    Returns
    -------
    u : (H, W) ndarray
        Relative depth, in (0, 1] inside the mask.
    down, right : (H, W) ndarray
        Outward direction in the image plane.
    """
    distance, deepest = _depth(mask)
    return distance / deepest, *_outward(distance, deepest)


def silhouette_normals(mask: np.ndarray, profile: SilhouetteProfile) -> np.ndarray:
    """Compute unit normals from the mean of a profile.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    profile : SilhouetteProfile

    Returns
    -------
    (H, W, 3) ndarray
        Camera frame; (0, 0, 1) outside the mask.
    """
    distance, deepest = _depth(mask)
    smooth = _smoothed(distance, deepest)
    normal = np.empty((*mask.shape, 3))
    for block in row_blocks(mask.shape, halo=1):
        rows = block.rows
        down, right = (part[block.own] for part in _descent(smooth[block.wide]))
        mean = profile.at(distance[rows] / deepest)[0]
        in_plane = np.where(mask[rows], np.clip(mean, -_MAX_IN_PLANE, _MAX_IN_PLANE), 0)
        part = np.dstack([in_plane * right, -in_plane * down, np.sqrt(1 - in_plane**2)])
        normal[rows] = part / length(part)[..., None]
    return normal


def _depth(mask: np.ndarray) -> tuple[np.ndarray, float]:
    """Distance of each pixel (H, W) from the silhouette, and the largest, at least 1.

    Ones if there is no silhouette.
    """
    padded = np.pad(mask, 1, mode="edge")
    distance = np.ones(mask.shape) if padded.all() else distance_to(~padded)[1:-1, 1:-1]
    return distance, max(float(distance.max()), 1.0)


def _outward(distance: np.ndarray, deepest: float) -> tuple[np.ndarray, np.ndarray]:
    return _descent(_smoothed(distance, deepest))


def _smoothed(distance: np.ndarray, deepest: float) -> np.ndarray:
    return gaussian_average(distance, max(1.0, _SMOOTHING * deepest))


def _descent(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The unit direction of steepest descent of a map, down and right, each (H, W)."""
    down, right = np.gradient(height)
    slope = np.maximum(np.hypot(down, right), 1e-6)
    return -down / slope, -right / slope


def normals_from_silhouette(mask: np.ndarray, profile: SilhouetteProfile) -> SilhouetteNormals:
    """Return the normals that a profile expects inside a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    profile : SilhouetteProfile

    Returns
    -------
    SilhouetteNormals
    """
    distance, deepest = _depth(mask)
    u, (down, right) = distance / deepest, _outward(distance, deepest)
    mean, spread = profile.at(u)
    maps = (mean * down, mean * right, 1 / spread**2, deepest * _dome_at(u, profile))
    return SilhouetteNormals(*(np.where(mask, values, 0) for values in maps))


def _dome_at(u: np.ndarray, profile: SilhouetteProfile) -> np.ndarray:
    """Heights at relative depths `u`, in units of the largest distance."""
    steps = np.linspace(0, 1, _STEPS)
    in_plane = np.clip(profile.at(steps)[0], -_MAX_IN_PLANE, _MAX_IN_PLANE)
    slope = in_plane / np.sqrt(1 - in_plane**2)
    return np.interp(
        u, steps, np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(steps))])
    )


def normals_cost(
    n1: np.ndarray, n2: np.ndarray, valid: np.ndarray, expected: ExpectedNormals, weight: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """Compute the term of expected normals.

    Parameters
    ----------
    n1, n2 : (H, W) ndarray
        Components of the unit normal, down and right.
    valid : (H, W) bool ndarray
    expected : ExpectedNormals
    weight : float

    Returns
    -------
    cost : float
    gradient_n1, gradient_n2 : (H, W) ndarray
    """
    precision = scaled_precision(expected.precision, valid, weight).astype(n1.dtype)
    residual1, residual2 = n1 - expected.down.astype(n1.dtype), n2 - expected.right.astype(n1.dtype)
    gradient1, gradient2 = precision * residual1, precision * residual2
    return (
        0.5 * float((gradient1 * residual1 + gradient2 * residual2).sum(dtype=float)),
        gradient1,
        gradient2,
    )
