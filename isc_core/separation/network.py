"""Separation by what rendered objects have taught: the layers of `layer_network`, brought to a
photo of any size.

Problem: the network sees an object at the size it was fitted to; photos are larger, and their
highlights have sharp edges.

Equation: the photo, averaged so that the object is `long_side` pixels long, gives y = log(I / D)
and the scale b of its error; y is carried to the photo's pixels linearly, and D = I exp(-y). What
is below the network's own error says nothing: y is taken as max(y - d b, 0) of d = `doubt`. What is
taken off so is held to the colours of light, see `light_tint`. Confidence is 1 / (1 + e / u): e = D
b, the error to be expected, u a tenth of the mean light.

Citation: see `layer_network`.

Limits: those of the network; an object of few pixels is seen as it is. Clipped pixels: see
`clipped`.
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
from .support.light_tint import held_to_light

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
    """Splits `image` (H, W, 3), linear, inside `mask` (H, W) bool; `clipped` (H, W) bool.
    `network`: the shipped one if None.

    Raises `InputError` for unfit options and arrays, `Cancelled`.
    """
    options, monitor = options or NetworkOptions(), monitor or Monitor()
    if options.long_side < STRIDE or options.doubt < 0 or not options.tint >= 1:
        raise InputError(
            f"the network needs a long side of {STRIDE} pixels or more, a doubt of 0 or more, and "
            "a tint of 1 or more"
        )
    check_arrays(image, mask, clipped)
    monitor.report("separating (network)", 0.0)
    excess, error = log_ratio(image, mask, network or LayerNetwork.shipped(), options)
    seen = np.where(mask[..., None], image, 0)
    diffuse = held_to_light(seen, seen * np.exp(-excess), options.tint)
    split = diffuse_layers(image, mask, diffuse, clipped)
    unit = max(_UNIT * float(image[mask].mean(dtype=float)), 1e-30)
    trust = 1 / (1 + error * split.diffuse.mean(axis=2) / unit)
    known = mask if clipped is None else mask & ~clipped
    return replace(split, confidence=np.where(known, trust, 0).astype(np.float32))
