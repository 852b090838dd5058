"""The pixels that a lobe is fitted to: all bright ones, some of the dark ones, and how far each is believed.

Equation: the deviation of a pixel of specular light s is sigma = sqrt(floor^2 + (relative s)^2), floor being a share of the peak; its
weight is its confidence times the number of pixels that it stands for. Pixels are taken at even steps along their order in brightness,
the same for the same picture.

Citation: W. G. Cochran, "Sampling techniques", 3rd edition (1977) (systematic sampling; no DOI).

Limits: a clipped pixel tells a lower bound only; it counts where the model is darker.
"""

from dataclasses import dataclass

import numpy as np

_BRIGHT = 0.03  # of the peak
_PEAK_PIXELS = 5  # the peak is the mean of that many: one hot pixel is no highlight


@dataclass(frozen=True)
class Pixels:
    """N pixels: `normal` (N, 3), `colour` (N, 3) and its mean `value` (N,), `sigma` and `weight` (N,), `clipped` (N,) bool,
    `place` (N, 2) rows and columns; `peak` of the highlight, `bright`: how many pixels of the picture reach half of it."""

    normal: np.ndarray
    colour: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    weight: np.ndarray
    clipped: np.ndarray
    place: np.ndarray
    peak: float
    bright: int


def choose_pixels(
    specular: np.ndarray, normal: np.ndarray, inside: np.ndarray, confidence: np.ndarray, clipped: np.ndarray,
    noise: tuple[float, float], most: int,
) -> Pixels:  # fmt: skip
    """At most about `most` of the pixels `inside` (H, W). `noise`: the floor as a share of the peak, and the relative part."""
    value = specular[inside].mean(axis=1)
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
        normal=normal[inside][taken],
        colour=specular[inside][taken],
        value=value[taken],
        sigma=np.maximum(sigma, np.finfo(float).tiny),
        weight=np.concatenate(weights) * confidence[inside][taken],
        clipped=clipped[inside][taken],
        place=np.argwhere(inside)[taken],
        peak=peak,
        bright=int((value > 0.5 * peak).sum()),
    )
