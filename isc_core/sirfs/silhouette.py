"""What the outline says of the inside: near the silhouette surfaces lean outward, deep inside they
face the viewer.

For a pixel at distance d from the silhouette, u = d / max d, let c be the outward direction (minus
the gradient of the smoothed distance) and t = (N1, N2) the normal's part in the image plane. Over
real objects t has mean m(u) c and spread s(u) a component:
  cost = w/n_v * sum over valid pixels of |t - m(u) c|^2 / (2 s(u)^2).
The profile m, s is fitted to objects of known shape (`fitting`). The occluding contour alone speaks
only of the outline itself; this term carries it inward, where convex and concave would otherwise be
equally likely. The dome that the profile adds up to is where the solver begins. Ours; in the spirit
of inflation from contours (Terzopoulos, Witkin & Kass 1988, doi:10.1016/0004-3702(88)90080-X).
Limits: one object seen whole; hollow forms disagree with it.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from .priors.priors import SilhouetteProfile

_STEPS = 257
_STEEPEST = 0.99  # largest in-plane part of a normal
# Share of the largest distance: the outward direction ignores finer detail of the silhouette.
_SMOOTHING = 0.05


@dataclass(frozen=True)
class ExpectedNormals:
    """Expected in-plane part of the normal, `down` and `right`, and its `precision` 1/s^2, each (H,
    W); 0 outside the mask.

    `dome`: (H, W) heights in pixels of what leans so everywhere, a slope of m / sqrt(1 - m^2) at
    depth u adding up to Z(d) = d_max integral_0^u m / sqrt(1 - m^2) du; 0 outside.
    """

    down: np.ndarray
    right: np.ndarray
    precision: np.ndarray
    dome: np.ndarray


def silhouette_coordinates(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Relative depth u in (0, 1] and the outward direction (down, right) of every pixel of `mask`
    (H, W) bool.

    A mask that reaches the border goes on beyond it: there is no silhouette. One without any
    outline is deep everywhere, u = 1.
    """
    distance, deepest = _depth(mask)
    return distance / deepest, *_outward(distance, deepest)


def silhouette_normals(mask: np.ndarray, profile: SilhouetteProfile) -> np.ndarray:
    """Unit normals (H, W, 3), camera frame, that lean outward as `profile` says on average;

    (0, 0, 1) outside `mask` (H, W) bool.
    """
    u, down, right = silhouette_coordinates(mask)
    lean = np.where(mask, np.clip(profile.at(u)[0], -_STEEPEST, _STEEPEST), 0)
    normal = np.dstack([lean * right, -lean * down, np.sqrt(1 - lean**2)])
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _depth(mask: np.ndarray) -> tuple[np.ndarray, float]:
    """How far each pixel (H, W) lies behind the outline, and the most of it, at least 1.

    Ones where there is no outline.
    """
    padded = np.pad(mask, 1, mode="edge")
    distance = (
        np.ones(mask.shape) if padded.all() else ndimage.distance_transform_edt(padded)[1:-1, 1:-1]
    )
    return distance, max(float(distance.max()), 1.0)


def _outward(distance: np.ndarray, deepest: float) -> tuple[np.ndarray, np.ndarray]:
    smooth = ndimage.gaussian_filter(distance, max(1.0, _SMOOTHING * deepest))
    down, right = np.gradient(smooth)
    length = np.maximum(np.hypot(down, right), 1e-6)
    return -down / length, -right / length


def normals_from_silhouette(mask: np.ndarray, profile: SilhouetteProfile) -> ExpectedNormals:
    """What `profile` expects inside `mask` (H, W) bool."""
    distance, deepest = _depth(mask)
    u, (down, right) = distance / deepest, _outward(distance, deepest)
    mean, spread = profile.at(u)
    maps = (mean * down, mean * right, 1 / spread**2, deepest * _dome_at(u, profile))
    return ExpectedNormals(*(np.where(mask, values, 0) for values in maps))


def _dome_at(u: np.ndarray, profile: SilhouetteProfile) -> np.ndarray:
    """Heights at relative depths `u`, in units of the largest distance."""
    steps = np.linspace(0, 1, _STEPS)
    lean = np.clip(profile.at(steps)[0], -_STEEPEST, _STEEPEST)
    slope = lean / np.sqrt(1 - lean**2)
    return np.interp(
        u, steps, np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(steps))])
    )


def silhouette_cost(
    n1: np.ndarray, n2: np.ndarray, valid: np.ndarray, field: ExpectedNormals, weight: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """The term and its gradients with respect to n1 and n2, all (H, W)."""
    scale = weight / max(int(valid.sum()), 1)
    strength = (np.where(valid, field.precision, 0) * scale).astype(n1.dtype)
    away1, away2 = n1 - field.down.astype(n1.dtype), n2 - field.right.astype(n1.dtype)
    pull1, pull2 = strength * away1, strength * away2
    return 0.5 * float((pull1 * away1 + pull2 * away2).sum(dtype=float)), pull1, pull2
