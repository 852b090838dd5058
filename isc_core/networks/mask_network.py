"""Which pixels of a photo show the thing that it is a photo of.

Problem: a photo of a thing before a room or a table has no mask. What stands in front, all of one
piece, with a shadow of its own, is seen from what things look like, not from colours alone.

Equation: an encoder of convolutions (`networks.layers`) computes feature maps of the photo, each
half as fine as the one before; a decoder goes back up with the encoder's maps beside it. Pixels go
in and come out in blocks of 4 x 4 (space to depth). Each pixel gets the log odds of being part of
the thing. Means and maxima of the coarse feature maps give the log odds of none, one and several
things. Photo and mirror image are averaged. Hints, if there are any, are drawn into channels of
their own: points on the thing, points on the background, a box. What the network says together
makes it as sure as a logistic regression on photos that the weights have not seen tells.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28; hints as channels: N. Xu et al., "Deep interactive object
selection", CVPR 2016, doi:10.1109/CVPR.2016.47; sureness: J. Platt, "Probabilistic outputs for
support vector machines", 1999. Weights, training pictures and losses are our own: `python -m
training.masks.mask_network`.

Limits: measured in docs/methods/automatic_mask.md. It sees 96 pixels of the longer side.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..errors import InputError
from .layers import (
    DARK,
    average_pool,
    conv_block,
    convolved,
    depth_to_space,
    is_chain,
    softmax,
    space_to_depth,
)
from .loader import Network, Parameters

SIDE, BLOCK = 96, 4  # pixels of the network's frame, and of a block
INPUTS = 9
POINT = 2.5  # pixels: radius of a point's disc
COARSE = 2  # levels that the number of things is read from, the coarsest ones
SURENESS = 6
_LEAST = 1e-6


class Count(IntEnum):
    """How many things a photo is of."""

    NONE = 0
    ONE = 1
    SEVERAL = 2


@dataclass(frozen=True)
class MaskNetwork(Network):
    """The mask network. Raises `InputError` where parts do not fit each other.

    Attributes
    ----------
    weights : tuple of (9, inputs, outputs) float32 ndarray
        Two for each level down, two for each level up from the coarsest, the output.
    biases : tuple of (outputs,) float32 ndarray
    dense : tuple of (inputs, outputs) ndarray
        The two layers of the number of things.
    offsets : tuple of (outputs,) ndarray
    sureness : (SURENESS,) ndarray
        Weights of the log odds that a mask is right, see `isc_core.masking.evidence`.
    """

    title = "mask network"
    file = "mask_network.npz"

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    dense: tuple[np.ndarray, ...]
    offsets: tuple[np.ndarray, ...]
    sureness: np.ndarray

    def __post_init__(self) -> None:
        if not self._fits():
            raise InputError(
                "these are not the weights of a mask network of this version: "
                "fit them anew, or use the shipped ones"
            )

    def _fits(self) -> bool:
        if len(self.weights) < 7 or len(self.weights) % 4 != 3:
            return False
        if any(w.ndim != 3 for w in self.weights) or any(m.ndim != 2 for m in self.dense):
            return False
        down = 2 * self._levels
        wide = [w.shape[-1] for w in self.weights[1:down:2]]
        shapes, inputs = list[tuple[int, ...]](), BLOCK**2 * INPUTS
        for width in wide:
            shapes += [(9, inputs, width), (9, width, width)]
            inputs = width
        for skip, up in zip(wide[-2::-1], self.weights[down:-1:2], strict=True):
            width = up.shape[-1]
            shapes += [(9, skip + inputs, width), (9, width, width)]
            inputs = width
        shapes.append((9, inputs, BLOCK**2))
        hidden = self.dense[0].shape[-1]
        counts = [(2 * sum(wide[-COARSE:]), hidden), (hidden, len(Count))]
        return (
            is_chain(self.weights, self.biases, shapes)
            and [m.shape for m in self.dense] == counts
            and [o.shape for o in self.offsets] == [s[1:] for s in counts]
            and self.sureness.shape == (SURENESS,)
        )

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> "MaskNetwork":
        """Build the network.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        MaskNetwork

        Raises
        ------
        InputError, KeyError
            If the parameters do not fit.
        """
        others = parameters.others
        return cls(
            parameters.weights,
            parameters.biases,
            (others["hidden_weight"], others["count_weight"]),
            (others["hidden_bias"], others["count_bias"]),
            others["sureness"],
        )

    @property
    def _levels(self) -> int:
        return (len(self.weights) + 1) // 4

    def __call__(self, channels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predict the mask and the number of things.

        Parameters
        ----------
        channels : (H, W, INPUTS) ndarray
            See `channels_of`; sides are multiples of 32.

        Returns
        -------
        odds : (H, W) float32 ndarray
            Log odds of the thing.
        counts : (3,) ndarray
            Log odds of `Count`.
        """
        steps = iter(zip(self.weights, self.biases, strict=True))
        layer, skips = space_to_depth(channels, BLOCK), []
        for level in range(self._levels):
            layer = conv_block(layer if level == 0 else average_pool(layer), steps)
            skips.append(layer)
        counts = self._counts(skips[-COARSE:])
        for skip in skips[-2::-1]:
            layer = conv_block(
                np.concatenate([skip, layer.repeat(2, axis=0).repeat(2, axis=1)], axis=2), steps
            )
        return depth_to_space(convolved(layer, *next(steps)), BLOCK)[..., 0], counts

    def _counts(self, layers: list[np.ndarray]) -> np.ndarray:
        features = []
        for layer in layers:
            values = layer.astype(np.float64)
            features += [values.mean(axis=(0, 1)), values.max(axis=(0, 1))]
        hidden = np.einsum("n,nk->k", np.concatenate(features), self.dense[0]) + self.offsets[0]
        return np.einsum("n,nk->k", np.maximum(hidden, 0), self.dense[1]) + self.offsets[1]


@dataclass(frozen=True)
class MaskPrediction:
    """What the network says of a photo.

    Attributes
    ----------
    cover : (H, W) float32 ndarray
        Probability of the thing at each pixel of the frame; 0 outside of the photo.
    counts : (3,) ndarray
        Probabilities of `Count`.
    """

    cover: np.ndarray
    counts: np.ndarray


def predict_mask(
    light: np.ndarray, frame: np.ndarray, hints: np.ndarray, network: MaskNetwork | None = None
) -> MaskPrediction:
    """Predict the mask of a small photo.

    Parameters
    ----------
    light : (side, side, 3) ndarray
        Linear, not negative; `SIDE` pixels or another multiple of 32.
    frame : (side, side) bool ndarray
        The photo's place in the frame.
    hints : (side, side, 3) ndarray
        See `channels_of`.
    network : MaskNetwork, optional
        By default the shipped one.

    Returns
    -------
    MaskPrediction
        That of the mirrored photo is mirrored.
    """
    network = network or MaskNetwork.shipped()
    odds, counts = network(channels_of(light, frame, hints))
    mirrored = network(channels_of(light[:, ::-1], frame[:, ::-1], hints[:, ::-1]))
    odds = (odds + mirrored[0][:, ::-1]) / 2
    counts = (counts + mirrored[1]) / 2
    cover = np.where(frame, 1 / (1 + np.exp(-np.clip(odds, -30, 30))), 0)
    return MaskPrediction(cover.astype(np.float32), softmax(counts))


def channels_of(light: np.ndarray, frame: np.ndarray, hints: np.ndarray) -> np.ndarray:
    """Return the channels of the first layer.

    Parameters
    ----------
    light : (H, W, 3) ndarray
        Linear.
    frame : (H, W) bool ndarray
        Where the photo is.
    hints : (H, W, 3) ndarray
        1 on points of the thing, on points of the background, in the box; else 0.

    Returns
    -------
    (H, W, INPUTS) float32 ndarray
        Log light over the photo's mean and the frame; right and up from the middle of the frame,
        half its side being 1; the hints. All are 0 outside of the photo.
    """
    rows, columns = frame.shape
    inside = frame[..., None].astype(np.float32)
    right = ((np.arange(columns) + 0.5) * (2 / columns) - 1).astype(np.float32)
    up = (1 - (np.arange(rows) + 0.5) * (2 / rows)).astype(np.float32)
    place = np.stack(np.meshgrid(right, up), axis=2)
    light = np.where(frame[..., None], light, 0).astype(np.float32)
    # rows first, then the sums of rows in pairs that mirroring exchanges: the mirrored photo has
    # the same mean to the last bit
    lines = light.sum(axis=(0, 2), dtype=np.float64)
    mean = float((lines + lines[::-1]).sum()) / (6 * max(int(frame.sum()), 1))
    log_light = np.log(light / np.float32(max(mean, _LEAST)) + np.float32(DARK))
    return np.concatenate(
        [log_light * inside, inside, place * inside, hints.astype(np.float32) * inside], axis=2
    )
