"""The pixels that a lobe is fitted to: all bright ones and some of the dark ones, with weights.

Equation: the deviation of a pixel of specular light s is sigma = sqrt(floor^2 + (relative s)^2),
floor being a share of the peak; its weight is its confidence times the number of pixels that it
represents. Pixels are chosen at even steps in their order of brightness, so that the same image
gives the same pixels.

Citation: W. G. Cochran, "Sampling techniques", 3rd edition (1977) (systematic sampling; no DOI).

Limits: a clipped pixel is only a lower bound; its residual is used where the model is darker.
"""

from dataclasses import dataclass

import numpy as np

from .observed import Observed

_BRIGHT, _DARK = 0.03, 1e-3  # of the peak
_PEAK_PIXELS = 5  # the peak is their mean: a single hot pixel is not a highlight


@dataclass(frozen=True, eq=False)
class Pixels:
    """N pixels.

    Attributes
    ----------
    normal : (N, 3) ndarray
        Unit normals.
    position : (N, 3) ndarray
        See `SurfacePositions`; 0 where unknown.
    colour : (N, 3) ndarray
        Specular light.
    value : (N,) ndarray
        Its mean over the channels.
    sigma, weight : (N,) ndarray
        Deviation and weight.
    clipped : (N,) ndarray of bool
        Where the light is a lower bound.
    cell : (N, 2) ndarray
        Row and column.
    peak : float
        Of the highlight.
    dark : float
        Light below this is treated as 0.
    bright : int
        Number of pixels of the image that reach half of the peak.
    peak_clipped : float
        Share of the peak's pixels that are clipped.
    """

    normal: np.ndarray
    position: np.ndarray
    colour: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    weight: np.ndarray
    clipped: np.ndarray
    cell: np.ndarray
    peak: float
    dark: float
    bright: int
    peak_clipped: float


def choose_pixels(observed: Observed, noise: tuple[float, float], max_pixels: int) -> Pixels:
    """Choose the pixels for a fit.

    Parameters
    ----------
    observed : Observed
        The specular image.
    noise : tuple of float
        The floor as a share of the peak, and the relative part.
    max_pixels : int
        Approximate maximum number of pixels.

    Returns
    -------
    Pixels
        Deterministic.
    """
    inside = observed.inside
    value = observed.brightness
    order = np.argsort(-value, kind="stable")
    peak = float(value[order[:_PEAK_PIXELS]].mean())
    bright = int((value > _BRIGHT * peak).sum())
    parts, weights = [], []
    for part, share in (
        (order[:bright], max_pixels // 2),
        (order[bright:], max_pixels - max_pixels // 2),
    ):
        step = max(1, -(-len(part) // max(share, 1)))
        chosen = part[::step]
        parts.append(chosen)
        weights.append(np.full(len(chosen), len(part) / max(len(chosen), 1)))
    chosen = np.concatenate(parts)
    sigma = np.sqrt((noise[0] * peak) ** 2 + (noise[1] * value[chosen]) ** 2)
    cell = np.argwhere(inside)[chosen]
    return Pixels(
        normal=np.asarray(observed.normal[inside][chosen], float),
        position=np.zeros((len(chosen), 3))
        if observed.positions is None
        else observed.positions.at(cell),
        colour=np.asarray(observed.specular[inside][chosen], float),
        value=value[chosen],
        sigma=np.maximum(sigma, np.finfo(float).tiny),
        weight=np.concatenate(weights) * observed.confidence[inside][chosen],
        clipped=observed.clipped[inside][chosen],
        cell=cell,
        peak=peak,
        dark=_DARK * peak,
        bright=int((value > 0.5 * peak).sum()),
        peak_clipped=float(observed.clipped[inside][order[:_PEAK_PIXELS]].mean()),
    )
