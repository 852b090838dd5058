"""The pixels that a lobe is fitted to: all bright ones and some of the dark ones, with weights.

Equation: the deviation of a pixel of specular light s is sigma = sqrt(floor^2 + (relative s)^2),
floor being a share of the peak; its weight is its confidence times the number of pixels that it
represents. Pixels are taken at even steps in their order of brightness, so that the same image
gives the same pixels.

Citation: W. G. Cochran, "Sampling techniques", 3rd edition (1977) (systematic sampling; no DOI).

Limits: a clipped pixel is a lower bound only; it counts where the model is darker.
"""

from dataclasses import dataclass

import numpy as np

from .observed import Observed

_BRIGHT, _DARK = 0.03, 1e-3  # of the peak
_PEAK_PIXELS = 5  # the peak is the mean of that many: one hot pixel is no highlight


@dataclass(frozen=True)
class Pixels:
    """N pixels.

    Attributes
    ----------
    normal : (N, 3) ndarray
        Unit normals.
    place : (N, 3) ndarray
        See `Places`; 0 where unknown.
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
        Light that counts as none.
    bright : int
        Number of pixels of the image that reach half of the peak.
    peak_clipped : float
        Share of the peak's pixels that are clipped.
    """

    normal: np.ndarray
    place: np.ndarray
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


def choose_pixels(seen: Observed, noise: tuple[float, float], most: int) -> Pixels:
    """Choose pixels to fit to.

    Parameters
    ----------
    seen : Observed
        The specular image.
    noise : tuple of float
        The floor as a share of the peak, and the relative part.
    most : int
        At most about so many.

    Returns
    -------
    Pixels
        The same for the same image.
    """
    inside = seen.inside
    value = seen.brightness
    order = np.argsort(-value, kind="stable")
    peak = float(value[order[:_PEAK_PIXELS]].mean())
    bright = int((value > _BRIGHT * peak).sum())
    parts, weights = [], []
    for part, share in ((order[:bright], most // 2), (order[bright:], most - most // 2)):
        step = max(1, -(-len(part) // max(share, 1)))
        taken = part[::step]
        parts.append(taken)
        weights.append(np.full(len(taken), len(part) / max(len(taken), 1)))
    taken = np.concatenate(parts)
    sigma = np.sqrt((noise[0] * peak) ** 2 + (noise[1] * value[taken]) ** 2)
    cell = np.argwhere(inside)[taken]
    return Pixels(
        normal=np.asarray(seen.normal[inside][taken], float),
        place=np.zeros((len(taken), 3)) if seen.places is None else seen.places.at(cell),
        colour=np.asarray(seen.specular[inside][taken], float),
        value=value[taken],
        sigma=np.maximum(sigma, np.finfo(float).tiny),
        weight=np.concatenate(weights) * seen.confidence[inside][taken],
        clipped=seen.clipped[inside][taken],
        cell=cell,
        peak=peak,
        dark=_DARK * peak,
        bright=int((value > 0.5 * peak).sum()),
        peak_clipped=float(seen.clipped[inside][order[:_PEAK_PIXELS]].mean()),
    )
