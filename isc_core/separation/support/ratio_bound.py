"""A lower bound of predicted highlights, and whether a photo has any.

Problem: the network also mistakes some bright albedo for highlights, and light that is removed by
mistake does more harm than a highlight that remains.

Equation: the network predicts y = log(I / D) with a Laplace distribution of scale b, its mean
absolute deviation. At a pixel, t = max(y - d b, 0) is a lower bound of y for d = `deviations`: more
than the highlight is removed with a probability of exp(-d) / 2 only. Highlights stand out in a
photo if t, opened so that texture of a few pixels does not count, exceeds its 90th percentile by
`stands_out` somewhere.

Citation: see `networks.scene_network`; grey opening: J. Serra, "Image Analysis and Mathematical
Morphology", 1982.

Limits: those of the network.
"""

from dataclasses import dataclass

import numpy as np

from ...filters.extrema import opened
from ...imaging.bounding_box import mask_diagonal
from ...networks.scene_network import LayerPrediction, ScenePrediction

_MOST_SHARE = 0.9  # of the pixels show no more than what is usual
_SPECK = 0.005  # of the object's diagonal


@dataclass(frozen=True)
class RemovalOptions:
    """When light that a network predicts to be a highlight is removed.

    Attributes
    ----------
    stands_out : float
        By how much the strongest highlight exceeds what is usual on the object.
    tint : float
        How coloured the removed light may be, see `light_tint`; at least 1.
    """

    stands_out: float = 0.6
    tint: float = 1.5


def ratio_lower_bound(
    prediction: ScenePrediction | LayerPrediction, deviations: float
) -> np.ndarray:
    """Return a lower bound of the predicted log ratio of a photo and its diffuse image.

    Parameters
    ----------
    prediction : ScenePrediction or LayerPrediction
    deviations : float
        d of the module; not negative.

    Returns
    -------
    (H, W, 3) float32 ndarray
        Not negative, 0 outside the mask.
    """
    return np.maximum(prediction.log_ratio - deviations * prediction.ratio_scale[..., None], 0)


def highlights_stand_out(ratio: np.ndarray, mask: np.ndarray, stands_out: float) -> bool:
    """Decide whether a photo has highlights at all.

    Parameters
    ----------
    ratio : (H, W, 3) ndarray
        Log ratio of the photo and what would be left.
    mask : (H, W) ndarray of bool
    stands_out : float

    Returns
    -------
    bool
    """
    diagonal = mask_diagonal(mask)
    side = max(3, 2 * round(_SPECK * diagonal) + 1)
    broad = opened(ratio.mean(axis=2), side)[mask]
    return float(broad.max() - np.quantile(broad, _MOST_SHARE)) > stands_out
