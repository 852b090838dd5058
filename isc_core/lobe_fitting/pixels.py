"""The pixels that a lobe is fitted to: all bright ones, some of the dark ones, and how far each is
believed.

Equation: the deviation of a pixel of specular light s is sigma = sqrt(floor^2 + (relative s)^2),
floor being a share of the peak; its weight is its confidence times the number of pixels that it
stands for. Pixels are taken at even steps along their order in brightness, the same for the same
picture.

Citation: W. G. Cochran, "Sampling techniques", 3rd edition (1977) (systematic sampling; no DOI).

Limits: a clipped pixel tells a lower bound only; it counts where the model is darker.
"""

from dataclasses import dataclass

import numpy as np

from .observed import Observed

_BRIGHT, _DARK = 0.03, 1e-3  # of the peak
_PEAK_PIXELS = 5  # the peak is the mean of that many: one hot pixel is no highlight


@dataclass(frozen=True)
class Pixels:
    """N pixels: `normal` (N, 3), `place` (N, 3) (zeros where not known), `colour` (N, 3) and its
    mean `value` (N,), `sigma` and `weight` (N,), `clipped` (N,) bool, `cell` (N, 2): rows and
    columns. `peak` of the highlight; `dark`: as good as no light; `bright`: how many pixels of the
    picture reach half of the peak; `peak_clipped`: the share of the pixels of the peak that are
    clipped.
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
    """At most about `most` of the pixels inside.

    `noise`: the floor as a share of the peak, and the relative part.
    """
    inside = seen.inside
    value = seen.specular[inside].mean(axis=1)
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
    return Pixels(
        normal=seen.normal[inside][taken],
        place=np.zeros((len(taken), 3)) if seen.place is None else seen.place[inside][taken],
        colour=seen.specular[inside][taken],
        value=value[taken],
        sigma=np.maximum(sigma, np.finfo(float).tiny),
        weight=np.concatenate(weights) * seen.confidence[inside][taken],
        clipped=seen.clipped[inside][taken],
        cell=np.argwhere(inside)[taken],
        peak=peak,
        dark=_DARK * peak,
        bright=int((value > 0.5 * peak).sum()),
        peak_clipped=float(seen.clipped[inside][order[:_PEAK_PIXELS]].mean()),
    )
