"""Where a highlight is, on paint that has hardly a colour: brightness, smoothness, texture and colour weighed together.

Problem: a highlight on grey paint has the paint's own colour, and what splits light by colour has to leave it alone. But it is brighter
than what is around it, it is smooth where paint has edges, and, being ADDED, it brings the contrast of texture and paint down. None of
these is proof; together they tell how much of a pixel's light was probably added.

Equation: y(x) = log(I / I_diffuse) = log(1 + exp(w2 . tanh(W1 f(x) + b1) + b2 - 2)), f: 34 features of the pixel, its surroundings at
five widths in shares of the object's size, all of them ratios, so that neither exposure nor scale matters. The weights minimise Huber's
loss of y on glossy objects whose layers are known and on matt ones, with Gaussian noise on the features and weight decay. What all of an
object's pixels have in common (the low quantile of y) is taken off: a veil over everything cannot be told from brighter light.

Citation: the loss: P. J. Huber 1964, doi:10.1214/aoms/1177703732; averages inside the mask: see `smoothing`. Features and network are our
own; `python -m benchmarks.highlight_training` fits it.

Limits: a broad veil is hardly seen, and small y are common on matt texture: only large ones mean something.
"""

import importlib.resources
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy import ndimage

from .smoothing import masked_gaussian

_LONG_SIDE = 160  # pixels of the object, about, at which features are taken
_WIDTHS = (0.006, 0.015, 0.035, 0.08, 0.2)  # of the object's diagonal
_DARK = 0.02  # of the median light: below, ratios mean nothing
_MARGIN = 2.0  # of the network's output: without evidence it says "hardly anything"
_COMMON = 0.25  # the quantile that all pixels are taken to have in common
_MOST = 6.0


@dataclass(frozen=True)
class CueNetwork:
    """`mean`, `deviation` (F,): of the features; `hidden` (F, K), `hidden_bias` (K,), `output` (K,), `output_bias`: see the module."""

    mean: np.ndarray
    deviation: np.ndarray
    hidden: np.ndarray
    hidden_bias: np.ndarray
    output: np.ndarray
    output_bias: float

    def excess(self, found: np.ndarray) -> np.ndarray:
        """y >= 0 (N,) of features (N, F)."""
        layer = np.tanh((found - self.mean) / self.deviation @ self.hidden + self.hidden_bias)
        return np.asarray(np.logaddexp(0, layer @ self.output + self.output_bias - _MARGIN))


@cache
def shipped_network() -> CueNetwork:
    """The network that comes with the package."""
    resource = importlib.resources.files(__package__.rpartition(".")[0]) / "data" / "highlight_cue.npz"
    with importlib.resources.as_file(resource) as path:
        return read_network(path)


def read_network(path: Path) -> CueNetwork:
    """A network as an archive of its fields."""
    with np.load(path, allow_pickle=False) as data:
        mean, deviation, hidden, hidden_bias, output = (data[name] for name in ("mean", "deviation", "hidden", "hidden_bias", "output"))
        return CueNetwork(mean, deviation, hidden, hidden_bias, output, float(data["output_bias"]))


def highlight_excess(image: np.ndarray, mask: np.ndarray, network: CueNetwork | None = None) -> np.ndarray:
    """log(image / diffuse) >= 0, (H, W) float32, of `image` (H, W, 3) linear, inside `mask` (H, W) bool; 0 outside and where in doubt."""
    found = np.zeros(mask.shape, np.float32)
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    small, inside, factor = reduced(image[box], mask[box])
    excess = np.zeros(inside.shape, np.float32)
    excess[inside] = (network or shipped_network()).excess(features(small, inside))
    excess[inside] = np.maximum(excess[inside] - np.quantile(excess[inside], _COMMON), 0)
    if factor > 1:
        known = masked_gaussian(excess, inside, 0.5)
        places = np.meshgrid(*((np.arange(n) + 0.5) / factor - 0.5 for n in mask[box].shape), indexing="ij")
        excess = ndimage.map_coordinates(np.where(inside, excess, known), places, order=1, mode="nearest")
    found[box] = np.where(mask[box], excess, 0)
    return found


def reduced(image: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Image (h, w, 3) and mask (h, w), averaged over blocks of the mask's pixels, and the blocks' side: about `_LONG_SIDE` are left."""
    factor = max(1, round(max(mask.shape) / _LONG_SIDE))
    rows, columns = -(-mask.shape[0] // factor), -(-mask.shape[1] // factor)
    down, right = (0, rows * factor - mask.shape[0]), (0, columns * factor - mask.shape[1])
    share = np.pad(mask.astype(np.float32), (down, right)).reshape(rows, factor, columns, factor).mean(axis=(1, 3))
    planes = np.pad(np.where(mask[..., None], image, 0).astype(np.float32), (down, right, (0, 0)))
    mean = planes.reshape(rows, factor, columns, factor, 3).mean(axis=(1, 3)) / np.maximum(share, 1e-6)[..., None]
    inside = share > 0.5 if (share > 0.5).any() else share > 0
    return np.where(inside[..., None], mean, 0), inside, factor


def features(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(N, 34) float32 of the mask's pixels, of `image` (h, w, 3) >= 0 as `reduced` gives it."""
    light, low, high = image.mean(axis=2), image.min(axis=2), image.max(axis=2)
    diagonal, dark = float(np.hypot(mask.shape[0], mask.shape[1])), float(_DARK * np.median(light[mask]) + 1e-9)

    def around(layer: np.ndarray, width: float) -> np.ndarray:
        return masked_gaussian(layer.astype(np.float32), mask, width * diagonal)

    wide = [around(light, width) for width in _WIDTHS]
    log_light = np.log(light + dark)
    found = [log_light - np.log(layer + dark) for layer in wide]
    found += [log_light - np.log(level + dark) for level in np.quantile(light[mask], (0.5, 0.9, 0.99))]
    whiteness = (low + dark) / (high + dark)
    found.append(whiteness)
    found += [whiteness - (around(low, width) + dark) / (around(high, width) + dark) for width in _WIDTHS]
    found += [np.log(low + dark) - np.log(around(low, width) + dark) for width in _WIDTHS[1:4]]
    found += _extremes(wide[0], mask, dark, diagonal)
    found += _texture(light, wide, mask, dark, diagonal)
    found += [np.log(high - low + dark) - np.log(around(high - low, width) + dark) for width in _WIDTHS[1:4]]
    found.append(np.minimum(ndimage.distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1] / (0.1 * diagonal), 1))
    return np.clip(np.nan_to_num(np.stack(found, axis=-1)[mask]), -_MOST, _MOST).astype(np.float32)


def _extremes(smooth: np.ndarray, mask: np.ndarray, dark: float, diagonal: float) -> list[np.ndarray]:
    """Against the darkest and the brightest of two neighbourhoods."""
    found = []
    for width in (0.03, 0.1):
        side = 2 * round(width * diagonal) + 1
        lowest = ndimage.minimum_filter(np.where(mask, smooth, smooth.max()), side)
        highest = ndimage.maximum_filter(np.where(mask, smooth, 0), side)
        found += [np.log((smooth + dark) / (lowest + dark)), np.log((smooth + dark) / (highest + dark))]
    return found


def _texture(light: np.ndarray, wide: list[np.ndarray], mask: np.ndarray, dark: float, diagonal: float) -> list[np.ndarray]:
    """How rough the light is, as it is and relative to its level, fine and coarse; and whether it has peaks or holes."""
    found = []
    floor = 0.15 * dark
    for detail, width in ((light - wide[0], 0.02), (wide[0] - wide[2], 0.06)):
        rough = np.log(masked_gaussian(np.abs(detail), mask, width * diagonal) + floor)
        relative = rough - np.log(masked_gaussian(light, mask, width * diagonal) + dark)
        found += [relative, relative - np.median(relative[mask]), rough - np.median(rough[mask])]
    for detail, width in ((light - wide[0], 0.03), (wide[0] - wide[2], 0.08)):
        spread = np.sqrt(masked_gaussian(detail**2, mask, width * diagonal)) + floor
        found.append(np.cbrt(masked_gaussian(detail**3, mask, width * diagonal)) / spread)
    detail = wide[0] - wide[2]
    found.append(detail / (np.sqrt(np.square(detail[mask]).mean()) + dark))
    return found
