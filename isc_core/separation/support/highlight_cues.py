"""Cues that distinguish a highlight from pale reflectance: edges, texture, and chroma.

White light raises all channels equally, so it leaves the chroma C = max I - min I unchanged. White
reflectance, printed or mixed in, looks the same to a single pixel, but C falls where it begins.
Four cues follow, each a number or a map of a photo's candidate specular layer s. A reflectance edge
is where log C steps; steps of s next to it prove nothing. A highlight is smooth: s has little
detail finer than a few pixels, reflectance has texture. Reflectance mixes: where white reflectance
begins, s rises by (1 + q) times the fall of C, q = min / (max - min) of the reflectance; light does
not. Objects whose bright pixels are grey on the whole offer no colour to decide by.

The cues and their combination are ours. That a highlight leaves C unchanged is the two-band image
of K.-J. Yoon, Y. Choi and I. S. Kweon (ICIP 2006, doi:10.1109/ICIP.2006.312650); for the chroma and
the diffuse ratio see H.-L. Shen and Z.-H. Zheng (2013), doi:10.1364/AO.52.004483.

Limits: pale reflectance without edges and without texture, on a coloured object, passes for a broad
highlight.
"""

from dataclasses import dataclass

import numpy as np

from ...filters.gaussian import gaussian_average
from ...filters.morphology import eroded
from ...imaging.smoothing import masked_gaussian, weighted_gaussian

_TINY = 1e-12


def ramp(value: np.ndarray | float, ends: tuple[float, float]) -> np.ndarray:
    """Return a smooth step: 0 up to the first end, 1 from the second on, a cubic between.

    Parameters
    ----------
    value : ndarray or float
    ends : tuple of float
        May descend; then the step does.

    Returns
    -------
    ndarray
    """
    low, high = ends
    t = np.clip((np.asarray(value) - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def noise_level(image: np.ndarray, mask: np.ndarray) -> float:
    """Estimate the standard deviation of the noise, robustly (Immerkaer 1996,
    doi:10.1006/cviu.1996.0060).

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    float
        Mean over the channels.
    """
    mirrored = np.pad(image.astype(float), [(1, 1), (1, 1), (0, 0)], mode="symmetric")
    change = np.diff(np.diff(mirrored, 2, axis=0), 2, axis=1) / 6
    return float(1.4826 * np.median(np.abs(change[mask]), axis=0).mean())


@dataclass(frozen=True, eq=False)
class Steps:
    """Differences of a photo between neighbouring pixels, in units of an edge.

    Attributes
    ----------
    across, down : (H, W) ndarray
        To the left and the upper neighbour; 0 where one of the two is not in the mask.
    """

    across: np.ndarray
    down: np.ndarray

    def around(self) -> np.ndarray:
        """Return the larger difference of both sides, summed over the two directions (H, W)."""
        across, down = self.across.copy(), self.down.copy()
        across[:, :-1] = np.maximum(across[:, :-1], self.across[:, 1:])
        down[:-1] = np.maximum(down[:-1], self.down[1:])
        return across + down


def steps_of(
    change: list[tuple[np.ndarray, float]], mask: np.ndarray, floor: np.ndarray | float
) -> Steps:
    """Return the steps of several maps.

    Parameters
    ----------
    change : list of (ndarray, float)
        Maps (H, W) or (H, W, C), each with the step that counts as an edge.
    mask : (H, W) bool ndarray
    floor : (H, W) ndarray or float
        The effect of noise.

    Returns
    -------
    Steps
    """

    def along(axis: int) -> np.ndarray:
        steps = np.zeros(mask.shape, np.float32)
        inside = steps[:, 1:] if axis == 1 else steps[1:]
        for values, unit in change:
            difference = np.abs(np.diff(values, axis=axis))
            inside += (difference if values.ndim == 2 else difference.sum(axis=2)) / unit
        limit = np.broadcast_to(floor, mask.shape)
        inside -= limit[:, 1:] if axis == 1 else limit[1:]
        both = mask[:, 1:] & mask[:, :-1] if axis == 1 else mask[1:] & mask[:-1]
        inside[~both] = 0
        return np.maximum(steps, 0)

    return Steps(along(1), along(0))


def far_from_borders(steps: Steps, mask: np.ndarray, blur: float, unit: float) -> np.ndarray:
    """Return a weight in [0, 1], near 0 on edges and within `blur` pixels of them.

    Parameters
    ----------
    steps : Steps
    mask : (H, W) bool ndarray
    blur, unit : float

    Returns
    -------
    (H, W) ndarray
        0 outside the mask.
    """
    border = masked_gaussian(np.minimum(steps.around(), 1), mask, blur)
    return np.where(mask, np.exp(-np.square(border / unit)), 0).astype(np.float32)


def roughness(
    specular: np.ndarray, weight: np.ndarray, mask: np.ndarray, scale: float, fine: float
) -> tuple[float, np.ndarray]:
    """Return the share of fine detail in what exceeds its surroundings.

    Parameters
    ----------
    specular, weight : (H, W) ndarray
        The layer, and the weight of its pixels.
    mask : (H, W) bool ndarray
    scale, fine : float
        Extents in pixels of the surroundings and of fine detail.

    Returns
    -------
    whole : float
        Over all raised pixels; 0 for a smooth highlight, near 1 for texture and noise.
    local : (H, W) ndarray
    """
    raised = np.where(mask, specular - weighted_gaussian(specular, weight, scale, 1e-6), 0)
    detail = np.square(raised - gaussian_average(raised, fine))
    squared = np.where(mask, np.square(weight), 0)
    up = squared * (raised > 0)
    over_all = np.sqrt(
        (up * detail).sum(dtype=float) / max((up * np.square(raised)).sum(dtype=float), _TINY)
    )
    below = gaussian_average(squared * np.square(raised), scale) + _TINY
    return float(over_all), np.sqrt(gaussian_average(squared * detail, scale) / below)


def reflectance_mixing(
    specular: np.ndarray, chroma: np.ndarray, ratio: np.ndarray, mask: np.ndarray, scale: float
) -> np.ndarray:
    """Return how much of the layer's rise is white reflectance: 1; for light about 0.

    It is the share of grad s that runs against grad C, times 1 + q.

    Parameters
    ----------
    specular, chroma, ratio : (H, W) ndarray
        s, C and q.
    mask : (H, W) bool ndarray
    scale : float
        In pixels.

    Returns
    -------
    (H, W) ndarray
    """
    if min(mask.shape) < 2:
        return np.zeros_like(specular)
    down, across = np.gradient(specular)
    chroma_down, chroma_across = np.gradient(chroma)
    inner = eroded(mask, 2)
    against = np.where(inner, -(down * chroma_down + across * chroma_across) * (1 + ratio), 0)
    steep = np.where(inner, np.square(down) + np.square(across), 0)
    return gaussian_average(against, scale) / (gaussian_average(steep, scale) + _TINY)
