"""Separation by the layer network, for photos of any size.

Problem: the network sees an object at the size it was trained at; photos are larger, and their
highlights have sharp edges.

Equation: the photo, averaged so that the object is `long_side` pixels long, gives y = log(I / D)
and the scale b of its error; y is upsampled linearly to the photo's pixels, and D = I exp(-y). What
is below the network's own error is ignored: y becomes max(y - d b, 0) with d = `doubt`.
`light_tint` limits the colour of the removed light. Confidence is 1 / (1 + e / u) with e = D b, the
expected error, and u a tenth of the mean light.

Citation: see `networks.layer_network`.

Limits: those of the network; an object of few pixels is not enlarged. Clipped pixels: see
`support.clipped`.
"""

from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..networks.layer_network import LayerNetwork, NetworkOptions, log_ratio
from ..networks.layers import STRIDE
from ..progress import Monitor
from ..scene.decomposition import Separation
from .support.checks import check_arrays
from .support.layers import diffuse_layers
from .support.light_tint import limit_tint

_UNIT = 0.1  # of the mean light: an error of this size halves the confidence


VARIANTS: dict[str, NetworkOptions] = {"improved": NetworkOptions()}


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: NetworkOptions | None = None,
    *,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
    network: LayerNetwork | None = None,
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
    network : LayerNetwork, optional
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
    if options.long_side < STRIDE or options.doubt < 0 or not options.tint >= 1:
        raise InputError(
            f"the method network needs long_side at least {STRIDE}, doubt at least 0 and tint at "
            "least 1"
        )
    check_arrays(image, mask, clipped)
    monitor.report("separating (network)", 0.0)
    excess, error = log_ratio(image, mask, network or LayerNetwork.shipped(), options)
    inside = np.where(mask[..., None], image, 0)
    diffuse = limit_tint(inside, inside * np.exp(-excess), options.tint)
    split = diffuse_layers(image, mask, diffuse, clipped)
    unit = max(_UNIT * float(image[mask].mean(dtype=float)), 1e-30)
    confidence = 1 / (1 + error * split.diffuse.mean(axis=2) / unit)
    unclipped = mask if clipped is None else mask & ~clipped
    return replace(split, confidence=np.where(unclipped, confidence, 0).astype(np.float32))
