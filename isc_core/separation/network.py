"""Separation by what rendered objects have taught: the layers of `layer_network`, brought to a photo of any size.

Problem: the network sees an object at the size it was fitted to; photos are larger, and their highlights have sharp edges.

Equation: the photo, averaged so that the object is `long_side` pixels long, gives y = log(I / D) and the scale b of its error; y is carried
to the photo's pixels linearly, and D = I exp(-y). What is below the network's own error says nothing: y is taken as max(y - d b, 0) of
d = `doubt`. Confidence is 1 / (1 + e / u): e = D b, the error to be expected, u a tenth of the mean light.

Citation: see `layer_network`.

Limits: those of the network; an object of few pixels is seen as it is. Clipped pixels: see `clipped`.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..box import mask_slices
from ..decomposition import Separation
from ..errors import InputError
from ..photo import averaged
from ..progress import Monitor
from .checks import check_arrays
from .layer_network import STRIDE, LayerNetwork, shipped_network
from .layers import diffuse_layers
from .smoothing import masked_gaussian

_MARGIN = 8  # pixels around the object: what lies beyond the picture's frame is background as well
_UNIT = 0.1  # of the mean light: an error of this size halves the confidence


@dataclass(frozen=True)
class NetworkOptions:
    """`long_side`: of the object, in pixels, as the network sees it, >= 32. `doubt` >= 0: how many scales of error y has to exceed."""

    long_side: int = 176
    doubt: float = 0.0


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
    """Splits `image` (H, W, 3), linear, inside `mask` (H, W) bool; `clipped` (H, W) bool. `network`: the shipped one if None.

    Raises `InputError` for unfit options and arrays, `Cancelled`.
    """
    options, monitor = options or NetworkOptions(), monitor or Monitor()
    if options.long_side < STRIDE or options.doubt < 0:
        raise InputError(f"the network needs a long side of {STRIDE} pixels or more, and a doubt of 0 or more")
    check_arrays(image, mask, clipped)
    monitor.report("separating (network)", 0.0)
    excess, error = log_ratio(image, mask, network or shipped_network(), options)
    diffuse = np.where(mask[..., None], image, 0) * np.exp(-excess)
    split = diffuse_layers(image, mask, diffuse, clipped)
    unit = max(_UNIT * float(image[mask].mean(dtype=float)), 1e-30)
    trust = 1 / (1 + error * split.diffuse.mean(axis=2) / unit)
    known = mask if clipped is None else mask & ~clipped
    return replace(split, confidence=np.where(known, trust, 0).astype(np.float32))


def log_ratio(image: np.ndarray, mask: np.ndarray, network: LayerNetwork, options: NetworkOptions) -> tuple[np.ndarray, np.ndarray]:
    """y (H, W, 3) >= 0 and b (H, W) > 0, float32, 0 outside `mask` (H, W) bool, of `image` (H, W, 3)."""
    box = mask_slices(mask)
    small, inside, factor = averaged(image[box], mask[box], min(1.0, options.long_side / max(mask[box].shape)))
    framed, place = _framed(small, inside)
    raw, log_error = network(*framed)
    error = np.exp(log_error)
    excess = np.maximum(raw - options.doubt * error[..., None], 0)
    found = np.concatenate([excess, error[..., None]], axis=2)[place]
    whole = np.zeros((*mask.shape, 4), np.float32)
    whole[box] = np.where(mask[box][..., None], _carried(found, inside, mask[box].shape, factor), 0)
    return whole[..., :3], whole[..., 3]


def _framed(image: np.ndarray, mask: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], tuple[slice, slice]]:
    """Image and mask in the middle of a picture whose sides the network can halve, and where they are in it."""
    sides = [-(-(n + 2 * _MARGIN) // STRIDE) * STRIDE for n in mask.shape]
    place = tuple(slice((side - n) // 2, (side - n) // 2 + n) for side, n in zip(sides, mask.shape, strict=True))
    framed, inside = np.zeros((*sides, 3), np.float32), np.zeros(sides, bool)
    mean = max(float(image[mask].mean(dtype=float)), 1e-30)
    framed[place], inside[place] = np.where(mask[..., None], image / mean, 0), mask
    return (framed, inside), place  # type: ignore[return-value]


def _carried(found: np.ndarray, known: np.ndarray, shape: tuple[int, ...], factor: float) -> np.ndarray:
    """Maps (h, w, C), `known` (h, w) bool, at the pixels of a picture of `shape`: linear between pixels' centres."""
    if factor == 1:
        return found
    filled = np.where(known[..., None], found, masked_gaussian(found, known, 1.0))
    for axis, size in enumerate(shape):
        at = np.clip((np.arange(size) + 0.5) * factor - 0.5, 0, filled.shape[axis] - 1)
        first = np.minimum(at.astype(np.int64), max(filled.shape[axis] - 2, 0))
        beyond = (at - first).astype(np.float32).reshape([-1 if k == axis else 1 for k in range(3)])
        after = np.minimum(first + 1, filled.shape[axis] - 1)
        filled = (1 - beyond) * np.take(filled, first, axis) + beyond * np.take(filled, after, axis)
    return filled
