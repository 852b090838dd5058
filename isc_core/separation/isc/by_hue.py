"""The candidate by hue: its diffuse ratios, and its gain.

Problem: a highlight may cover a whole patch of one reflectance, so that nothing near it in the
photo shows the patch without.

Method: a low quantile of min I / max I over nearby pixels of similar hue (`hue_grid`) is the
diffuse ratio. The candidate is used on saturated objects only, if it is smooth and does not run
against C as white reflectance does (`highlight_cues`).

Limits: see the package.
"""

from dataclasses import dataclass

import numpy as np

from ...imaging.smoothing import weighted_gaussian
from ..support.highlight_cues import ramp, reflectance_mixing, roughness
from ..support.hue_grid import HueGrid, Places, quantile
from .object_maps import TINY, ObjectMaps, ratio_of, specular_of
from .options import IscOptions

_BINS, _CHROMA_BINS = 100, 64


@dataclass(frozen=True, eq=False)
class DiffuseRatios:
    """Diffuse statistics by hue, as tables over a grid.

    Attributes
    ----------
    grid : HueGrid
    places : Places
        Positions in the grid of the pixels from which the tables come.
    share : ndarray
        min D / max D.
    chroma : ndarray
        C in units of the photo's peak.
    """

    grid: HueGrid
    places: Places
    share: np.ndarray
    chroma: np.ndarray


def diffuse_ratios(photo: ObjectMaps, options: IscOptions) -> DiffuseRatios:
    """Collect the tables from bright, coloured pixels; `chroma` where the candidate s is small.

    Parameters
    ----------
    photo : ObjectMaps
    options : IscOptions

    Returns
    -------
    DiffuseRatios
    """
    mask, low, high, chroma = photo.mask, photo.low, photo.high, photo.chroma
    grid = HueGrid(
        (mask.shape[0], mask.shape[1]), max(options.cell * max(mask.shape), 1.0), options.hues
    )
    places = grid_places(grid, photo, 1)
    weight = (photo.usable & (low > photo.base) & (chroma > photo.base / 2))[mask].astype(
        np.float32
    )
    bins = np.minimum(
        (_BINS * low[mask] / np.maximum(high[mask], TINY)).astype(np.int64), _BINS - 1
    )
    near, everywhere = grid.histograms(places, bins, _BINS, weight)
    everywhere /= everywhere.sum(axis=-1, keepdims=True)
    near += options.borrowed * everywhere
    share = quantile(near, options.low_quantile)
    candidate = specular_of(low[mask], chroma[mask], places.read(share))
    weight *= np.exp(-np.square(candidate / np.maximum(0.1 * high[mask], TINY)))
    bins = np.minimum(
        (np.clip(chroma[mask] / photo.peak, 0, 1) * (_CHROMA_BINS - 0.01)).astype(np.int64),
        _CHROMA_BINS - 1,
    )
    near, everywhere = grid.histograms(places, bins, _CHROMA_BINS, weight)
    everywhere /= everywhere.sum(axis=-1, keepdims=True)
    near += 20 * everywhere
    return DiffuseRatios(grid, places, share, quantile(near, 0.5))


def grid_places(grid: HueGrid, photo: ObjectMaps, scale: float, first: int = 0) -> Places:
    """Return the positions of the mask's pixels in the grid.

    Parameters
    ----------
    grid : HueGrid
    photo : ObjectMaps
    scale : float
        Size of the photo over that of the image for which the grid was built.
    first : int, optional
        Row of the photo at which `photo` begins.

    Returns
    -------
    Places
    """
    rows, columns = np.nonzero(photo.mask)
    rows += first
    return grid.places(
        (rows + 0.5) / scale - 0.5, (columns + 0.5) / scale - 0.5, photo.hue[photo.mask]
    )


def hue_gain(
    photo: ObjectMaps,
    candidate: np.ndarray,
    share: np.ndarray,
    edge_weight: np.ndarray,
    options: IscOptions,
) -> np.ndarray:
    """Return the gain of the candidate: one factor for the object times local cues.

    Parameters
    ----------
    photo : ObjectMaps
    candidate : (H, W) ndarray
        s by hue.
    share : (H, W) ndarray
        min D / max D by hue.
    edge_weight : (H, W) ndarray
        Of `edge_weights`.
    options : IscOptions

    Returns
    -------
    (H, W) float32 ndarray
        In [0, 1].
    """
    mask, low = photo.mask, photo.low
    bright = ramp(low / photo.base, options.bright)
    specular = candidate * bright
    scale = max(0.015 * photo.diagonal, 2.5)
    rough, rough_here = roughness(specular, edge_weight, mask, scale, fine=1.5)
    gain = float(ramp(saturation_of(photo), options.colourful) * ramp(rough, options.smooth))
    if gain > 0:
        gain *= float(ramp(_mixing(photo, specular, share, edge_weight), options.unmixed))
    if gain == 0:
        return np.zeros(mask.shape, np.float32)
    clear = ramp(specular / (options.scatter * (low - specular) + TINY), options.clear)
    kept = _suppress_borders(specular * ramp(rough_here, options.smooth_here) * clear, edge_weight)
    return np.where(mask, gain * kept / np.maximum(candidate, TINY), 0)


def saturation_of(photo: ObjectMaps) -> float:
    """Return the saturation of the bright pixels: the sum of C over that of max I.

    Parameters
    ----------
    photo : ObjectMaps

    Returns
    -------
    float
        In [0, 1].
    """
    weight = np.where(photo.mask, ramp(photo.low / photo.base, (0.5, 1.2)), 0)
    brightness = (photo.high * weight).sum(dtype=float)
    return float((photo.chroma * weight).sum(dtype=float) / max(brightness, float(TINY)))


def _mixing(
    photo: ObjectMaps, specular: np.ndarray, share: np.ndarray, edge_weight: np.ndarray
) -> float:
    """The median reflectance mixing where the `candidate` (H, W) is strong."""
    inside = np.where(photo.mask, specular, 0)
    smooth = _suppress_borders(inside, np.square(edge_weight), reach=4.0)
    mixing = reflectance_mixing(
        smooth, photo.chroma, ratio_of(share), photo.usable, max(0.03 * photo.diagonal, 2.5)
    )
    values = inside[photo.mask]
    return float(np.median(mixing[photo.mask][values >= 0.3 * np.quantile(values, 0.99)]))


def _suppress_borders(
    specular: np.ndarray, edge_weight: np.ndarray, reach: float = 2.5
) -> np.ndarray:
    """`specular` (H, W), limited near edges (low `edge_weight`) to the level around them, within
    `reach` pixels.
    """
    around = weighted_gaussian(specular, edge_weight, reach, 1e-3)
    return edge_weight * specular + (1 - edge_weight) * np.minimum(around, specular)
