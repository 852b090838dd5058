"""The candidate by place, and its gain.

Problem: a hue may belong to several reflectances.

Method: the diffuse ratio is the mode over pixels that can be reached without crossing a reflectance
edge (`edge_aware`). The candidate is used where it exceeds the scatter of its own region, does not
run against C, and is smooth or also found by the groups of `sparse_coding`.

Limits: see the package.
"""

from concurrent.futures import Future

import numpy as np

from ...filters.extrema import window_maximum
from ...imaging.channels import largest, smallest
from ...imaging.smoothing import masked_gaussian
from ..support.edge_aware import Paths
from ..support.highlight_cues import ramp, reflectance_mixing, roughness, steps_of
from .object_maps import CHROMA_STEP, DARK, TINY, ObjectMaps, ratio_of
from .options import IscOptions

_SIGMA = 1.0  # of the smoothing, pixels
_SHARE_STEP = 0.1  # of the shares of the hue: an edge
# Reach as a share of the object's diagonal, scale tau of the robust weights, iterations, smallest
# step.
_REACH, _TAU, _ROUNDS, _MIN_STEP = 0.15, 0.1, 4, 0.01
# Extent of a highlight's faint rim around proven pixels, as a share of the object's diagonal.
_RIM = 0.02


def place_candidate(
    photo: ObjectMaps,
    usual_chroma: np.ndarray,
    edge_weight: np.ndarray,
    in_groups: "Future[np.ndarray]",
    options: IscOptions,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the candidate by place.

    Parameters
    ----------
    photo : ObjectMaps
    usual_chroma : (H, W) ndarray
        C of pixels of similar hue.
    edge_weight : (H, W) ndarray
        Of `edge_weights`.
    in_groups : Future
        The pending result of `grouped_specular`.
    options : IscOptions

    Returns
    -------
    candidate : (H, W) ndarray
        s.
    gain : (H, W) ndarray
        In [0, 1].
    share : (H, W) ndarray
        min D / max D.
    """
    mask = photo.mask
    smooth = np.where(mask[..., None], masked_gaussian(photo.image, mask, _SIGMA), 0)
    low, high = smallest(smooth), largest(smooth)
    chroma = high - low
    observed = low / np.maximum(high, TINY)
    paths = _paths(smooth, low, chroma, photo)
    weight = photo.usable.astype(np.float32)
    share = paths.lower_mode(observed, weight, _TAU, _ROUNDS)
    ratio, observed_ratio = ratio_of(share), ratio_of(observed)
    deviation = np.clip((observed_ratio - ratio) / np.maximum(ratio, np.float32(1e-3)), -1, 1)
    scatter = np.sqrt(paths.weighted(np.square(deviation), weight * (deviation <= 0)))
    candidate = np.where(mask, np.clip(low - ratio * chroma, 0, low), 0)
    error = np.hypot(
        np.hypot(scatter, options.scatter_here) * (low - candidate), 3 * photo.noise * (1 + ratio)
    )
    gain = ramp(candidate / np.maximum(error, TINY), (1.0, 3.0))
    gain *= ramp(photo.chroma / np.maximum(usual_chroma, TINY), options.present) * ramp(
        photo.low / photo.base, (0.5, 1.2)
    )
    scale = max(0.015 * photo.diagonal, 2.5)
    gain *= ramp(
        reflectance_mixing(candidate, photo.chroma, ratio, photo.usable, scale),
        options.unmixed_here,
    )
    safe = gain * edge_weight * ramp(1 - share, options.coloured)
    _, rough_here = roughness(candidate * safe, edge_weight, mask, scale, fine=1.5)
    agreed = np.minimum(gain, in_groups.result() / np.maximum(candidate, TINY))
    proven = np.where(mask, np.maximum(safe * ramp(rough_here, options.smooth_by_place), agreed), 0)
    # A highlight fades out: around proven pixels, weaker candidates belong to it as well.
    around = window_maximum(ramp(proven, options.proven), 2 * round(_RIM * photo.diagonal) + 1)
    faint = edge_weight * ramp(candidate / np.maximum(error, TINY), options.faint)
    faint *= ramp(photo.chroma / np.maximum(usual_chroma, TINY), options.present)
    return candidate, np.where(mask, np.maximum(proven, np.minimum(faint, around)), 0), share


def _paths(smooth: np.ndarray, low: np.ndarray, chroma: np.ndarray, photo: ObjectMaps) -> Paths:
    """Distances that grow across reflectance edges, and are infinite across the silhouette."""
    dark = DARK * photo.peak
    free = smooth - low[..., None]
    shares = free / (free.sum(axis=2) + np.float32(dark))[..., None]
    reach = _REACH * photo.diagonal
    steps = steps_of(
        [(shares, _SHARE_STEP), (np.log(chroma + dark), CHROMA_STEP)], photo.mask, _MIN_STEP
    )
    across, down = 1 + reach * steps.across, 1 + reach * steps.down
    across[:, 1:][photo.mask[:, 1:] != photo.mask[:, :-1]] = 1e6
    down[1:][photo.mask[1:] != photo.mask[:-1]] = 1e6
    return Paths(across, down, reach)
