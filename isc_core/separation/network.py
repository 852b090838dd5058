"""Separation by what the scene network sees, for photos of any size.

Problem: a highlight on a grey surface has the surface's colour; what reveals it is its form, its
place on the shape, and the reflectance around it. The network weighs them all, but it also takes
some bright albedo for highlights. Light that is wrongly taken off does more harm than a highlight
that stays.

Equation: the network expects y = log(I / D) with a Laplace distribution of scale b. At a pixel,
t = max(y - d b, 0) is taken off, d = `doubt`: more than what is there is removed with a probability
of exp(-d) / 2 only, so that the expected error falls. From the photo as a whole nothing is taken
unless highlights stand out: with t opened, so that texture of a few pixels does not
count, max t has to exceed the 90th percentile by `stands_out`. D = I exp(-t), and `light_tint`
limits the colour of the removed light. Confidence is 1 / (1 + e / u) with e = D b, the expected
error, and u a tenth of the mean light.

Citation: see `networks.scene_network`; grey opening: J. Serra, "Image Analysis and Mathematical
Morphology", 1982.

Limits: those of the network; edges of highlights are as sharp as its frame. Clipped pixels: see
`support.clipped`.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..errors import InputError
from ..imaging.bounding_box import mask_diagonal
from ..networks.scene_network import (
    LayerPrediction,
    SceneNetwork,
    ScenePrediction,
    predict_scene,
)
from ..progress import Monitor
from ..scene.decomposition import Separation
from .support.checks import check_arrays
from .support.layers import diffuse_layers
from .support.light_tint import limit_tint

_UNIT = 0.1  # of the mean light: an error of this size halves the confidence
_MOST_SHARE = 0.9  # of the pixels show no more than what is usual
_SPECK = 0.005  # of the object's diagonal


@dataclass(frozen=True)
class NetworkOptions:
    """When light is taken off.

    Attributes
    ----------
    doubt : float
        Number of error scales that y has to exceed; not negative.
    stands_out : float
        By how much the strongest highlight exceeds what is usual on the object.
    tint : float
        How coloured the removed light may be, see `support.light_tint`; at least 1.
    """

    doubt: float = 1.6
    stands_out: float = 0.6
    tint: float = 1.5


VARIANTS: dict[str, NetworkOptions] = {"improved": NetworkOptions()}


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: NetworkOptions | None = None,
    *,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
    network: SceneNetwork | None = None,
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
    network : SceneNetwork, optional
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
    options, monitor = options or NetworkOptions(), monitor or Monitor()
    if options.doubt < 0 or options.stands_out < 0 or not options.tint >= 1:
        raise InputError(
            "the method network needs doubt and stands_out at least 0 and tint at least 1"
        )
    check_arrays(image, mask, clipped)
    monitor.report("separating (network)", 0.0)
    seen = predict_scene(image, mask, network)
    excess = sure_ratio(seen, options)
    if not highlights_stand_out(excess, mask, options):
        excess = np.zeros_like(excess)
    inside = np.where(mask[..., None], image, 0)
    diffuse = limit_tint(inside, inside * np.exp(-excess), options.tint)
    split = diffuse_layers(image, mask, diffuse, clipped)
    unit = max(_UNIT * float(image[mask].mean(dtype=float)), 1e-30)
    confidence = 1 / (1 + seen.ratio_scale * split.diffuse.mean(axis=2) / unit)
    unclipped = mask if clipped is None else mask & ~clipped
    return replace(split, confidence=np.where(unclipped, confidence, 0).astype(np.float32))


def sure_ratio(seen: ScenePrediction | LayerPrediction, options: NetworkOptions) -> np.ndarray:
    """Return how much of the predicted log ratio of a photo and its diffuse image is sure.

    Parameters
    ----------
    seen : ScenePrediction or LayerPrediction
    options : NetworkOptions
        `doubt` is used.

    Returns
    -------
    (H, W, 3) float32 ndarray
        Not negative, 0 outside the mask.
    """
    return np.maximum(seen.log_ratio - options.doubt * seen.ratio_scale[..., None], 0)


def highlights_stand_out(ratio: np.ndarray, mask: np.ndarray, options: NetworkOptions) -> bool:
    """Decide whether a photo has highlights at all.

    Parameters
    ----------
    ratio : (H, W, 3) ndarray
        Log ratio of the photo and what would be left.
    mask : (H, W) ndarray of bool
    options : NetworkOptions
        `stands_out` is used.

    Returns
    -------
    bool
    """
    diagonal = mask_diagonal(mask)
    side = max(3, 2 * round(_SPECK * diagonal) + 1)
    broad = ndimage.grey_opening(ratio.mean(axis=2), side)[mask]
    return float(broad.max() - np.quantile(broad, _MOST_SHARE)) > options.stands_out
