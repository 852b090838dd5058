"""Parts common to the networks: an encoder, a decoder, and for some a global prediction.

Equation: inputs and outputs are blocks of pixels (space to depth). Each level of the encoder has
two convolutions (`layers`) and half the resolution of the previous one; each level of the decoder
receives the coarser level, upsampled by repetition, concatenated with the encoder's map of its own
resolution. Two dense layers make a global prediction from statistics of the coarse maps.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28.

Limits: those of `convolution`.
"""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from ..errors import InputError
from ..imaging.blocks import block_means
from .convolution import convolved
from .layers import conv_block, depth_to_space, is_chain, space_to_depth
from .loader import Network, Parameters

BLOCK = 4  # side of a block, pixels


@dataclass(frozen=True, eq=False)
class EncoderDecoder(Network):
    """A network that predicts maps from a photo. Raises `InputError` if the parts do not match.

    Attributes
    ----------
    inputs, outputs : int
        Channels per pixel.
    weights : tuple of (9, inputs, outputs) ndarray
        As they are stored, float16 or float32. Two for each level of the encoder, two for each of
        the decoder from the coarsest, the output.
    biases : tuple of (outputs,) float32 ndarray
    """

    inputs: ClassVar[int]
    outputs: ClassVar[int]

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        if not self.fits():
            raise InputError(
                f"these are not the weights of a {self.title} of this version: "
                "fit them again, or use the shipped ones"
            )

    def fits(self) -> bool:
        """Return whether the shapes of the parts match."""
        if len(self.weights) < 7 or len(self.weights) % 4 != 3:
            return False
        if any(w.ndim != 3 for w in self.weights):
            return False
        shapes, inputs = list[tuple[int, ...]](), BLOCK**2 * self.inputs
        for width in self.widths:
            shapes += [(9, inputs, width), (9, width, width)]
            inputs = width
        for skip, up in zip(
            self.widths[-2::-1], self.weights[2 * self.depth : -1 : 2], strict=True
        ):
            width = up.shape[-1]
            shapes += [(9, skip + inputs, width), (9, width, width)]
            inputs = width
        shapes.append((9, inputs, BLOCK**2 * self.outputs))
        return is_chain(self.weights, self.biases, shapes)

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> Self:
        """Build a network that has only these parts.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        EncoderDecoder
            Of the class on which it is called.

        Raises
        ------
        InputError
            If the parameters do not match.
        """
        return cls(parameters.weights, parameters.biases)

    @property
    def depth(self) -> int:
        """Number of levels."""
        return (len(self.weights) + 1) // 4

    @property
    def widths(self) -> list[int]:
        """Channels of the encoder's levels, finest first."""
        return [w.shape[-1] for w in self.weights[1 : 2 * self.depth : 2]]

    def forward(self, photos: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Apply encoder and decoder.

        Parameters
        ----------
        photos : (N, H, W, inputs) ndarray
            Channels of photos whose sides are multiples of `BLOCK` * 2^(depth - 1).

        Returns
        -------
        maps : (N, H, W, outputs) float32 ndarray
        levels : list of (N, h, w, width) ndarray
            The encoder's maps, finest first.
        """
        layers = space_to_depth(photos, BLOCK)
        steps, levels = iter(zip(self.weights, self.biases, strict=True)), list[np.ndarray]()
        for level in range(self.depth):
            layers = conv_block(_halved(layers) if level > 0 else layers, steps)
            levels.append(layers)
        for skips in levels[-2::-1]:
            layers = conv_block(_concatenated(skips, layers), steps)
        return depth_to_space(convolved(layers, *next(steps)), BLOCK), levels


@dataclass(frozen=True, eq=False)
class PhotoNetwork(EncoderDecoder):
    """A network that also makes a global prediction for the photo.

    Attributes
    ----------
    coarse : int
        Number of levels, the coarsest ones, that the global prediction uses: two features per
        channel.
    global_outputs : int
    stored : tuple of str
        Names in the archive: of the second dense layer, and of the calibration.
    dense : tuple of (inputs, outputs) ndarray
        The two dense layers.
    offsets : tuple of (outputs,) ndarray
    calibration : (n,) ndarray
        Parameters that are fitted after training.
    """

    coarse: ClassVar[int]
    global_outputs: ClassVar[int]
    stored: ClassVar[tuple[str, str]]

    dense: tuple[np.ndarray, ...]
    offsets: tuple[np.ndarray, ...]
    calibration: np.ndarray

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> Self:
        """Build the network.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        PhotoNetwork
            Of the class on which it is called.

        Raises
        ------
        InputError, KeyError
            If the parameters do not match.
        """
        others, (output, calibration) = parameters.others, cls.stored
        return cls(
            parameters.weights,
            parameters.biases,
            (others["hidden_weight"], others[f"{output}_weight"]),
            (others["hidden_bias"], others[f"{output}_bias"]),
            others[calibration],
        )

    def fits(self) -> bool:
        """Return whether the shapes of the parts match."""
        if not super().fits() or any(m.ndim != 2 for m in self.dense):
            return False
        hidden = self.dense[0].shape[-1]
        shapes = [(2 * sum(self.widths[-self.coarse :]), hidden), (hidden, self.global_outputs)]
        return [m.shape for m in self.dense] == shapes and [o.shape for o in self.offsets] == [
            s[1:] for s in shapes
        ]

    def parameters(self) -> tuple[np.ndarray, ...]:
        """Return all arrays of the network, in a fixed order.

        Returns
        -------
        tuple of ndarray
            Those that its predictions depend on.
        """
        return *self.weights, *self.biases, *self.dense, *self.offsets, self.calibration

    def predict_global(self, features: list[np.ndarray]) -> np.ndarray:
        """Compute the global prediction.

        Parameters
        ----------
        features : list of (channels,) float64 ndarray
            Means and maxima of the coarse maps.

        Returns
        -------
        (global_outputs,) ndarray
        """
        hidden = np.einsum("n,nk->k", np.concatenate(features), self.dense[0]) + self.offsets[0]
        return np.einsum("n,nk->k", np.maximum(hidden, 0), self.dense[1]) + self.offsets[1]


def _halved(layers: np.ndarray) -> np.ndarray:
    """The maps (N, H, W, C) at half their resolution; H is even."""
    photos, rows, columns, channels = layers.shape
    halved = block_means(layers.reshape(photos * rows, columns, channels), 2)
    return halved.reshape(photos, rows // 2, columns // 2, channels)


def _concatenated(skips: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """The maps (N, H, W, C) of the encoder with the coarser (N, H / 2, W / 2, D), upsampled."""
    width = skips.shape[3]
    both = np.empty((*skips.shape[:3], width + coarse.shape[3]), np.float32)
    both[..., :width] = skips
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        both[:, row::2, column::2, width:] = coarse
    return both
