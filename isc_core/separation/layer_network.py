"""The network that tells the diffuse layer of a photo from experience: what rendered glossy objects look like with and without gloss.

Problem: a highlight on grey paint has the paint's own colour; what gives it away is its form, how it lies on the shape, and what the paint
is around it. No local cue is proof; a network that has seen many objects weighs them all, near and far.

Equation: y_c(x) = log(I_c / D_c) >= 0 and log b(x), the scale of y's error, from log(I / mean I + .03) and the mask. An encoder of five
levels, each of two 3 x 3 convolutions with max(0, .), halved by averages of 2 x 2; a decoder that goes back up with the encoder's layers
beside it. Pixels go in and come out in blocks of 2 x 2 (space to depth), and y = log(1 + exp(o - 2)). The answers for the photo and its
mirror image are averaged. How coloured the light may be that is taken off so: see `light_tint`.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015, doi:10.1007/978-3-319-24574-4_28; blocks of pixels: W. Shi et al. 2016,
doi:10.1109/CVPR.2016.207. Weights, training scenes and loss are our own: `python -m benchmarks.layer_network_training`.

Limits: it knows lamps, panels and skies on opaque objects of one piece. What no colour and no form tells (a veil over everything) stays.
"""

import importlib.resources
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ..box import mask_slices
from ..enlarging import enlarged
from ..errors import InputError
from ..numpy_files import read_arrays
from ..photo import averaged
from .smoothing import masked_gaussian

STRIDE = 32  # pixels: sides of what the network sees are multiples
_DARK = 0.03  # of the mean light: below, logarithms are of noise
_MARGIN = 2.0  # of the output: without evidence it says "hardly anything"
_BLOCK = 2
_CHANNELS = 4  # y of three colours, log b
_BITS = 20  # of the largest factor: 9 x 1024 products of twice as many bits add up to less than 2^53
_FRAME = 8  # pixels around the object: what lies beyond the picture's frame is background as well


Steps = Iterator[tuple[np.ndarray, np.ndarray]]  # weights and biases of the convolutions still to come


@dataclass(frozen=True)
class NetworkOptions:
    """`long_side`: of the object, in pixels, as the network sees it, >= 32. `doubt` >= 0: how many scales of error y has to exceed.
    `tint` >= 1: how coloured the light may be that is taken off, see `light_tint`. `mirrored`: whether the answer is the mean of those for
    the photo and its mirror image, in twice the time."""

    long_side: int = 176
    doubt: float = 0.5
    tint: float = 1.5
    mirrored: bool = True


@dataclass(frozen=True)
class LayerNetwork:
    """`weights`: of each convolution (9, inputs, outputs) float32, rows of the 3 x 3 first; `biases` (outputs,). In the order of the data:
    two for each level down, two for each level up from the coarsest, the output."""

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        count = len(self.weights)
        fits = all(w.ndim == 3 and w.shape[0] == 9 and b.shape == w.shape[2:] for w, b in zip(self.weights, self.biases, strict=True))
        if count < 7 or count % 4 != 3 or not fits or self.weights[-1].shape[2] != _CHANNELS * _BLOCK**2:
            raise InputError("these are not the weights of a layer network")

    def __call__(self, image: np.ndarray, mask: np.ndarray, mirrored: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """y (H, W, 3) >= 0 and log b (H, W), float32, of `image` (H, W, 3) linear >= 0 and `mask` (H, W) bool; H, W multiples of 32.

        `mirrored`: see `NetworkOptions`.
        """
        raw = self._run(image, mask)
        if mirrored:
            raw = 0.5 * (raw + self._run(image[:, ::-1], mask[:, ::-1])[:, ::-1])
        return raw[..., :3], raw[..., 3]

    def summary(self, image: np.ndarray, mask: np.ndarray) -> np.ndarray:
        """What the encoder sees, wherever on the object: of each of its channels, from the finest level to the coarsest, mean, deviation
        and fourth moment's fourth root over the mask: (3 channels,) float64. Photo and mask as for a call."""
        sums = []
        cover = mask.astype(float)[..., None]
        for layer in self._encoded(image, mask, self._steps()):
            cover = _halved(cover)
            weight = cover[..., 0] / cover.sum()
            first, second, fourth = (np.einsum("ij,ijc->c", weight, layer.astype(float) ** power) for power in (1, 2, 4))
            sums += [first, np.sqrt(np.maximum(second - first**2, 0)), fourth**0.25]
        return np.concatenate(sums)

    def _steps(self) -> Steps:
        return iter(zip(self.weights, self.biases, strict=True))

    def _encoded(self, image: np.ndarray, mask: np.ndarray, steps: Steps) -> list[np.ndarray]:
        """The encoder's layers, the finest first."""
        layer, kept = _to_blocks(_inputs(image, mask)), []
        for level in range((len(self.weights) - 1) // 4 + 1):
            layer = _twice(layer if level == 0 else _halved(layer), steps)
            kept.append(layer)
        return kept

    def _run(self, image: np.ndarray, mask: np.ndarray) -> np.ndarray:
        steps = self._steps()
        kept = self._encoded(image, mask, steps)
        layer = kept[-1]
        for skipped in kept[-2::-1]:
            layer = _twice(np.concatenate([skipped, layer.repeat(2, axis=0).repeat(2, axis=1)], axis=2), steps)
        raw = _from_blocks(_convolved(layer, *next(steps)))
        raw[..., :3] = np.logaddexp(0, raw[..., :3] - np.float32(_MARGIN))
        return raw


def log_ratio(image: np.ndarray, mask: np.ndarray, network: LayerNetwork, options: NetworkOptions) -> tuple[np.ndarray, np.ndarray]:
    """y (H, W, 3) >= 0 and b (H, W) > 0, float32, 0 outside `mask` (H, W) bool, of `image` (H, W, 3)."""
    box = mask_slices(mask)
    small, inside, factor = _as_seen(image[box], mask[box], options.long_side)
    framed, place = _framed(small, inside)
    raw, log_error = network(*framed, options.mirrored)
    error = np.exp(log_error)
    excess = np.maximum(raw - options.doubt * error[..., None], 0)
    found = np.concatenate([excess, error[..., None]], axis=2)[place]
    whole = np.zeros((*mask.shape, 4), np.float32)
    whole[box] = np.where(mask[box][..., None], _carried(found, inside, mask[box].shape, factor), 0)
    return whole[..., :3], whole[..., 3]


def summary(image: np.ndarray, mask: np.ndarray, network: LayerNetwork, long_side: int = NetworkOptions.long_side) -> np.ndarray:
    """`LayerNetwork.summary` of `image` (H, W, 3) within `mask` (H, W) bool, the mean of those for the photo and its mirror image."""
    box = mask_slices(mask)
    small, inside, _ = _as_seen(image[box], mask[box], long_side)
    (framed, cover), _ = _framed(small, inside)
    return 0.5 * (network.summary(framed, cover) + network.summary(framed[:, ::-1], cover[:, ::-1]))


@cache
def shipped_network() -> LayerNetwork:
    """The network that comes with the package."""
    resource = importlib.resources.files(__package__.rpartition(".")[0]) / "data" / "layer_network.npz"
    with importlib.resources.as_file(resource) as path:
        return read_network(path)


def read_network(path: Path) -> LayerNetwork:
    """An archive of float16 or float32 arrays `weight00`, `bias00`, ... Raises `InputError` for a file that is none."""
    try:
        data = read_arrays(path)
        count = sum(name.startswith("weight") for name in data)
        weights, biases = ([data[f"{kind}{k:02d}"].astype(np.float32) for k in range(count)] for kind in ("weight", "bias"))
        if not all(np.isfinite(values).all() for values in (*weights, *biases)):
            raise ValueError("some of its numbers are not finite")
    except (ValueError, KeyError) as error:
        raise InputError(f"{path} holds no layer network: {error}") from error
    return LayerNetwork(tuple(weights), tuple(biases))


def _as_seen(image: np.ndarray, mask: np.ndarray, long_side: int) -> tuple[np.ndarray, np.ndarray, float]:
    """As `averaged`, an object that fills the picture no longer than `long_side`."""
    return averaged(image, mask, min(1.0, long_side / max(mask.shape)))


def _inputs(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(H, W, 4) float32: log light over the object's mean, 0 outside, and the mask."""
    light = np.where(mask[..., None], image, 0).astype(np.float32)
    mean = max(float(light.sum(dtype=float)) / (3 * max(int(mask.sum()), 1)), 1e-9)
    log_light = np.log(light / np.float32(mean) + np.float32(_DARK)) * mask[..., None]
    return np.concatenate([log_light, mask[..., None].astype(np.float32)], axis=2)


def _to_blocks(layer: np.ndarray) -> np.ndarray:
    """(H, W, C) as (H / 2, W / 2, 4 C), channels first in each block's order."""
    rows, columns, channels = layer.shape
    blocks = layer.reshape(rows // 2, 2, columns // 2, 2, channels)
    return np.ascontiguousarray(blocks.transpose(0, 2, 4, 1, 3)).reshape(rows // 2, columns // 2, 4 * channels)


def _from_blocks(layer: np.ndarray) -> np.ndarray:
    """The inverse of `_to_blocks`."""
    rows, columns, channels = layer.shape
    blocks = layer.reshape(rows, columns, channels // 4, 2, 2)
    return np.ascontiguousarray(blocks.transpose(0, 3, 1, 4, 2)).reshape(2 * rows, 2 * columns, channels // 4)


def _halved(layer: np.ndarray) -> np.ndarray:
    rows, columns, channels = layer.shape
    return layer.reshape(rows // 2, 2, columns // 2, 2, channels).mean(axis=(1, 3))


def _twice(layer: np.ndarray, steps: Steps) -> np.ndarray:
    for _ in range(2):
        layer = np.maximum(_convolved(layer, *next(steps)), 0)
    return layer


def _convolved(layer: np.ndarray, weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """3 x 3, zeros around: one matrix product of all neighbourhoods.

    Both factors are rounded to whole multiples of a power of two, so small that doubles hold every sum of their products exactly: the
    order of summing, which libraries choose by the number of threads, does not change a bit.
    """
    rows, columns, channels = layer.shape
    (seen, of_layer), (kernel, of_kernel) = _in_steps(layer), _in_steps(weight)
    padded = np.pad(seen, ((1, 1), (1, 1), (0, 0)))
    near = np.stack([padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)], axis=2)
    sums = near.reshape(-1, 9 * channels) @ kernel.reshape(-1, weight.shape[2])
    return (sums * (of_layer * of_kernel) + bias).astype(np.float32).reshape(rows, columns, -1)


def _in_steps(values: np.ndarray) -> tuple[np.ndarray, float]:
    """`values` in float64 as whole numbers of steps, at most 2^20 of them; and the step, a power of two."""
    most = float(np.abs(values).max())
    step = 2.0 ** (np.ceil(np.log2(most)) - _BITS) if most > 0 else 1.0
    return np.rint(values.astype(np.float64) / step), step


def _framed(image: np.ndarray, mask: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], tuple[slice, slice]]:
    """Image and mask in the middle of a picture whose sides the network can halve, and where they are in it."""
    sides = [-(-(n + 2 * _FRAME) // STRIDE) * STRIDE for n in mask.shape]
    place = tuple(slice((side - n) // 2, (side - n) // 2 + n) for side, n in zip(sides, mask.shape, strict=True))
    framed, inside = np.zeros((*sides, 3), np.float32), np.zeros(sides, bool)
    mean = max(float(image[mask].mean(dtype=float)), 1e-30)
    framed[place], inside[place] = np.where(mask[..., None], image / mean, 0), mask
    return (framed, inside), place  # type: ignore[return-value]


def _carried(found: np.ndarray, known: np.ndarray, shape: tuple[int, ...], factor: float) -> np.ndarray:
    """Maps (h, w, C), `known` (h, w) bool, at the pixels of a picture of `shape`: linear between pixels' centres."""
    if factor == 1:
        return found
    return enlarged(np.where(known[..., None], found, masked_gaussian(found, known, 1.0)), shape, 1 / factor)
