"""Separation by the highlight network, for photos of any size.

Problem: a highlight on a grey surface has the surface's colour; the cues are its form, its place on
the shape, and the reflectance around it. The network uses all of them, but it also mistakes some
bright albedo for highlights. Light that is removed by mistake does more harm than a highlight that
remains.

Equation: the network predicts specular light s, with a standard deviation
(`networks.highlight_network`); `log_odds_margin` is subtracted from its log odds. Where the odds
are right, removing s lowers the expected squared error; s of less than a fifth of a detail stays.
Nothing is removed from the photo unless t = log(I / (I - s)) stands out (`support.ratio_bound`) by
`stands_out`. D = I exp(-t), and `light_tint` limits the colour of the removed light. Confidence is
1 / (1 + e / u), e the deviation and u a tenth of the mean light.

Citation: see `networks.highlight_network`.

Limits: those of the network. Clipped pixels: see `support.clipped`.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..networks.highlight_network import (
    HighlightNetwork,
    HighlightPrediction,
    predict_highlights,
)
from ..progress import Monitor
from ..scene.decomposition import Separation
from .support.checks import check_arrays
from .support.layers import diffuse_layers
from .support.light_tint import limit_tint
from .support.ratio_bound import RemovalOptions, highlights_stand_out

_UNIT = 0.1  # of the mean light: an error of this size halves the confidence
_MIN_SHARE = 1e-3  # of a channel that stays
_LEAST_LIKELY = 0.2  # share of a detail that is specular: less stays


@dataclass(frozen=True)
class NetworkOptions(RemovalOptions):
    """Options of the method.

    Attributes
    ----------
    log_odds_margin : float
        Subtracted from the log odds of a highlight; not negative.
    stands_out, tint : float
        See `RemovalOptions`.
    """

    log_odds_margin: float = 0.0


VARIANTS = {"improved": NetworkOptions()}


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: NetworkOptions | None = None,
    *,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
    network: HighlightNetwork | None = None,
) -> Separation:
    """Separate a photo into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear light.
    mask : (H, W) bool ndarray
    options : NetworkOptions, optional
    clipped : (H, W) bool ndarray, optional
    monitor : Monitor, optional
    network : HighlightNetwork, optional
        By default the shipped one.

    Returns
    -------
    Separation

    Raises
    ------
    InputError
        If options or arrays are invalid.
    Cancelled
        If the user cancels.
    """
    options, monitor = options or VARIANTS["improved"], monitor or Monitor()
    if not (
        0 <= options.log_odds_margin < np.inf
        and 0 <= options.stands_out < np.inf
        and 1 <= options.tint < np.inf
    ):
        raise InputError(
            "the method network needs finite numbers: log_odds_margin and stands_out at least 0, "
            "tint at least 1"
        )
    check_arrays(image, mask, clipped)
    monitor.report("separating (network)", 0.0)
    unit = mean_unit(image, mask)
    image = (np.where(mask[..., None], image, 0) / unit).astype(np.float32)
    prediction = predict_highlights(image, mask, options.log_odds_margin, network)
    excess = expected_ratio(image, prediction)
    if not highlights_stand_out(excess, mask, options.stands_out):
        excess = np.zeros_like(excess)
    diffuse = limit_tint(image, image * np.exp(-excess), options.tint)
    split = diffuse_layers(image, mask, diffuse, clipped)
    error = max(_UNIT * float(image[mask].mean(dtype=float)), 1e-30)
    confidence = 1 / (1 + prediction.deviation / error)
    unclipped = mask if clipped is None else mask & ~clipped
    return Separation(
        unit * split.diffuse,
        unit * split.specular,
        unit * split.residual,
        np.where(unclipped, confidence, 0).astype(np.float32),
    )


def mean_unit(image: np.ndarray, mask: np.ndarray) -> np.float32:
    """Return a power of two near the mean light of an object.

    Dividing by it is exact, and makes the network's small constants independent of the exposure.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
        Not empty.

    Returns
    -------
    float32
        Positive.
    """
    mean = max(float(image[mask].mean(dtype=float)), 1e-30)
    return np.float32(2.0 ** np.round(np.log2(mean)))


def expected_ratio(image: np.ndarray, prediction: HighlightPrediction) -> np.ndarray:
    """Return the log ratio of a photo and of what remains of it without the predicted highlights.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    prediction : HighlightPrediction

    Returns
    -------
    (H, W, 3) float32 ndarray
        Not negative, 0 where there are no highlights, or only unlikely ones.
    """
    light = np.where(prediction.share > _LEAST_LIKELY, prediction.specular, 0)[..., None]
    inside, least = light > 0, np.float32(_MIN_SHARE) * image
    left = np.where(inside, np.maximum(image - light, least), 1)
    return np.log(np.where(inside, image, 1) / left).astype(np.float32)
