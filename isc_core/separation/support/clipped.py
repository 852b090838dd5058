"""The layers of clipped pixels, whose true value lies above the recorded one.

Problem: where the sensor saturates, image = diffuse + white specular no longer holds, and equations
that rely on colour differences turn the cores of highlights into black holes. Yet a saturated
channel alone is no highlight: saturated reflectance in strong light fills it too.

Equation: A is the diffuse layer interpolated from around the clipped region by pull-push
(`inpainting.pull_push`). Channels that are not clipped are still diffuse plus white: s is the least
I_c - A_c among them, or with all channels clipped the largest excess of any over A. It counts as
far as the pixel itself is nearly white, or as what the method removed there or just around is a
fair share of the brightness. Elsewhere the pixel stays unchanged. The diffuse value of a clipped
channel is A_c, but within [I_c - s, I_c]; what it lost is the residual, <= 0.

Limits: texture under a clipped highlight is lost; the fill is smooth. Clipped white reflectance is
refilled like a highlight.
"""

import numpy as np

from ...imaging.channels import largest, mean_channel, smallest
from ...inpainting.pull_push import fill_at
from ...scene.decomposition import Separation

# A channel at this share of the pixel's largest, clipped one counts as clipped too: scaling and
# compression blur the limit.
_FULL = 0.95
# Ramps over a pixel's smallest channel, and over white light in or around it, that indicate a
# highlight; shares of its largest channel.
_WHITE = (0.6, 0.8)
_LIT = (0.03, 0.1)


def explain_clipped(split: Separation, clipped: np.ndarray, mask: np.ndarray) -> Separation:
    """Recompute the layers of clipped pixels.

    There 0 <= diffuse <= image, the specular layer is white, the residual is not positive, and 0 in
    channels that are not clipped; the confidence is 0. A mask without any unclipped pixel keeps its
    layers.

    Parameters
    ----------
    split : Separation
    clipped, mask : (H, W) bool ndarray

    Returns
    -------
    Separation
    """
    valid = mask & ~clipped
    if not clipped.any() or not valid.any():
        return split
    image = split.diffuse[clipped] + split.specular[clipped] + split.residual[clipped]
    removed = mean_channel(split.specular)
    around = np.concatenate(
        [fill_at(values, valid, clipped) for values in (split.diffuse, removed[..., None])], axis=1
    )
    high = largest(image)
    full = image >= _FULL * high[:, None]
    light = np.maximum(around[:, 3], removed[clipped])
    gain = np.maximum(_ramp(smallest(image), high, _WHITE), _ramp(light, high, _LIT))
    white = gain * _white_over(image, around[:, :3], full)
    rest = image - white[:, None]
    diffuse, specular, residual = split.diffuse.copy(), split.specular.copy(), split.residual.copy()
    diffuse[clipped] = np.where(full, np.clip(around[:, :3], np.maximum(rest, 0), image), rest)
    specular[clipped] = white[:, None]
    residual[clipped] = np.where(full, np.minimum(rest - diffuse[clipped], 0), 0)
    return Separation(
        diffuse, specular, residual, np.where(clipped, np.float32(0), split.confidence)
    )


def _white_over(image: np.ndarray, around: np.ndarray, full: np.ndarray) -> np.ndarray:
    """s (n,) of clipped colours `image` (n, 3) over the diffuse ones `around` (n, 3), where `full`
    (n, 3) bool marks the clipped channels.
    """
    over = np.maximum(image - around, 0)
    return np.where(full.all(axis=1), largest(over), smallest(np.where(full, np.inf, over))).astype(
        np.float32
    )


def _ramp(value: np.ndarray, high: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    """Linear ramp (n,): 0 up to the first share of `high`, 1 from the second on; 0 where both
    are 0.
    """
    return np.clip(
        (value - ends[0] * high) / np.maximum((ends[1] - ends[0]) * high, np.float32(1e-30)), 0, 1
    )
