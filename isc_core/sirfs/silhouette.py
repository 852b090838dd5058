"""What the silhouette suggests of the normals inside: near it surfaces lean outward, far from it
they face the viewer.

Problem: the occluding contour constrains the silhouette itself only, and inside it convex and
concave are equally likely. This term carries the constraint inward.

Equation: for a pixel at distance d from the silhouette, u = d / max d, let c be the outward
direction (minus the gradient of the smoothed distance) and t = (N1, N2) the normal's part in the
image plane. Over real objects t has mean m(u) c and a spread s(u) of each component:
  cost = w/n_v * sum over valid pixels of |t - m(u) c|^2 / (2 s(u)^2).
The profile m, s is fitted to objects of known shape (`prior_fitting`). The dome whose normals are
the means is where the solver starts.

Citation: ours; in the spirit of inflation from contours (D. Terzopoulos, A. Witkin, M. Kass 1988,
doi:10.1016/0004-3702(88)90080-X).

Limits: one object, wholly inside the frame; hollow forms disagree with it.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..imaging.row_blocks import row_blocks
from .precision import strength_of
from .priors.priors import SilhouetteProfile

_STEPS = 257
_STEEPEST = 0.99  # largest in-plane part of a normal
# Share of the largest distance: the outward direction ignores finer detail of the silhouette.
_SMOOTHING = 0.05


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class SilhouetteNormals(ExpectedNormals):
    """Normals that a silhouette suggests, and the height map they add up to.

    Attributes
    ----------
    dome : (H, W) ndarray
        Height in pixels. With a slope of m / sqrt(1 - m^2) at depth u,
        Z(d) = d_max integral_0^u m / sqrt(1 - m^2) du.
    """

    dome: np.ndarray


def silhouette_coordinates(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute the relative depth and the outward direction of every pixel.

    A mask that reaches the border continues beyond it: there is no silhouette. A mask without any
    silhouette is deep everywhere, u = 1.

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
    """Compute unit normals that lean outward as a profile does on average.

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
        down, right = (part[block.own] for part in _downhill(smooth[block.wide]))
        mean = profile.at(distance[rows] / deepest)[0]
        lean = np.where(mask[rows], np.clip(mean, -_STEEPEST, _STEEPEST), 0)
        part = np.dstack([lean * right, -lean * down, np.sqrt(1 - lean**2)])
        normal[rows] = part / np.linalg.norm(part, axis=-1, keepdims=True)
    return normal


def _depth(mask: np.ndarray) -> tuple[np.ndarray, float]:
    """Distance of each pixel (H, W) from the silhouette, and the largest, at least 1.

    Ones if there is no silhouette.
    """
    padded = np.pad(mask, 1, mode="edge")
    distance = (
        np.ones(mask.shape) if padded.all() else ndimage.distance_transform_edt(padded)[1:-1, 1:-1]
    )
    return distance, max(float(distance.max()), 1.0)


def _outward(distance: np.ndarray, deepest: float) -> tuple[np.ndarray, np.ndarray]:
    return _downhill(_smoothed(distance, deepest))


def _smoothed(distance: np.ndarray, deepest: float) -> np.ndarray:
    return np.asarray(ndimage.gaussian_filter(distance, max(1.0, _SMOOTHING * deepest)))


def _downhill(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The direction in which a map falls, down and right, each (H, W)."""
    down, right = np.gradient(height)
    length = np.maximum(np.hypot(down, right), 1e-6)
    return -down / length, -right / length


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
    lean = np.clip(profile.at(steps)[0], -_STEEPEST, _STEEPEST)
    slope = lean / np.sqrt(1 - lean**2)
    return np.interp(
        u, steps, np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(steps))])
    )


def normals_cost(
    n1: np.ndarray, n2: np.ndarray, valid: np.ndarray, field: ExpectedNormals, weight: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """Compute the term of expected normals.

    Parameters
    ----------
    n1, n2 : (H, W) ndarray
        Components of the unit normal, down and right.
    valid : (H, W) bool ndarray
    field : ExpectedNormals
    weight : float

    Returns
    -------
    cost : float
    gradient_n1, gradient_n2 : (H, W) ndarray
    """
    strength = strength_of(field.precision, valid, weight).astype(n1.dtype)
    away1, away2 = n1 - field.down.astype(n1.dtype), n2 - field.right.astype(n1.dtype)
    pull1, pull2 = strength * away1, strength * away2
    return 0.5 * float((pull1 * away1 + pull2 * away2).sum(dtype=float)), pull1, pull2
