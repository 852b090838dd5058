"""Prediction of the diffuse layer of a photo from its appearance.

Problem: a highlight on a grey surface has the surface's colour; what reveals it is its form, its
position on the shape, and the reflectance around it. No local cue is proof; a network trained on
many objects weighs them all, near and far.

Equation: y_c(x) = log(I_c / D_c) >= 0 and log b(x), the scale of y's error, from log(I / mean I +
.03) and the mask. An encoder of five levels, each of two 3 x 3 convolutions with max(0, .) and
average pooling over 2 x 2; a decoder with the encoder's feature maps beside it. Pixels go in and
come out in blocks of 2 x 2 (space to depth), and y = log(1 + exp(o - 2)). The outputs for the photo
and its mirror image are averaged. `separation.support.light_tint` limits how coloured the removed
light may be.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28; blocks of pixels: W. Shi et al. 2016, doi:10.1109/CVPR.2016.207.
Weights, training scenes and loss are our own: `python -m training.networks.layer_network`.

Limits: it was trained on point lights, area lights and environment maps with opaque objects of one
piece. What neither colour nor form shows (a veil over everything) stays.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..imaging.bounding_box import mask_slices
from ..imaging.smoothing import masked_gaussian
from ..imaging.upsampling import enlarged
from .layers import BLOCK, conv_block, convolved, depth_to_space, encoded
from .loader import Network, Parameters
from .network_input import standardise_input

_MARGIN = 2.0  # offset of the output: its prior is a small log ratio
_CHANNELS = 4  # y of three colours, log b


@dataclass(frozen=True)
class NetworkOptions:
    """How the network is applied.

    Attributes
    ----------
    long_side : int
        Of the object, in pixels, as the network sees it; at least 32.
    doubt : float
        Number of error scales that y has to exceed; not negative.
    tint : float
        How coloured the removed light may be, see `separation.support.light_tint`; at least 1.
    mirrored : bool
        Average the predictions for the photo and its mirror image, in twice the time.
    """

    long_side: int = 176
    doubt: float = 0.5
    tint: float = 1.5
    mirrored: bool = True


@dataclass(frozen=True)
class LayerNetwork(Network):
    """A network for specular layers. Raises `InputError` where parts do not fit each other.

    Attributes
    ----------
    weights : tuple of (9, inputs, outputs) float32 ndarray
        Rows of the 3 x 3 kernel first. In the order of the data: two for each level down, two for
        each level up from the coarsest, the output.
    biases : tuple of (outputs,) float32 ndarray
    """

    title = "layer network"
    file = "layer_network.npz"

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        count = len(self.weights)
        fits = all(
            w.ndim == 3 and w.shape[0] == 9 and b.shape == w.shape[2:]
            for w, b in zip(self.weights, self.biases, strict=True)
        )
        if (
            count < 7
            or count % 4 != 3
            or not fits
            or self.weights[-1].shape[2] != _CHANNELS * BLOCK**2
        ):
            raise InputError("these are not the weights of a layer network")

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> "LayerNetwork":
        """Build the network.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        LayerNetwork

        Raises
        ------
        InputError
            If the parameters do not fit.
        """
        return cls(parameters.weights, parameters.biases)

    @property
    def encoder(self) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """The weights and biases of the levels down."""
        return self.weights[: 2 * self._levels], self.biases[: 2 * self._levels]

    @property
    def _levels(self) -> int:
        return (len(self.weights) - 1) // 4 + 1

    def __call__(
        self, image: np.ndarray, mask: np.ndarray, mirrored: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Predict the log ratio of image and diffuse layer.

        Parameters
        ----------
        image : (H, W, 3) ndarray
            Linear, not negative; H and W are multiples of 32.
        mask : (H, W) bool ndarray
        mirrored : bool
            See `NetworkOptions`.

        Returns
        -------
        y : (H, W, 3) float32 ndarray
            Not negative.
        log_error : (H, W) float32 ndarray
        """
        raw = self._run(image, mask)
        if mirrored:
            raw = 0.5 * (raw + self._run(image[:, ::-1], mask[:, ::-1])[:, ::-1])
        return raw[..., :3], raw[..., 3]

    def _run(self, image: np.ndarray, mask: np.ndarray) -> np.ndarray:
        steps = iter(zip(self.weights, self.biases, strict=True))
        skips = encoded(image, mask, steps, self._levels)
        layer = skips[-1]
        for skip in skips[-2::-1]:
            layer = conv_block(
                np.concatenate([skip, layer.repeat(2, axis=0).repeat(2, axis=1)], axis=2), steps
            )
        raw = depth_to_space(convolved(layer, *next(steps)))
        raw[..., :3] = np.logaddexp(0, raw[..., :3] - np.float32(_MARGIN))
        return raw


def log_ratio(
    image: np.ndarray, mask: np.ndarray, network: LayerNetwork, options: NetworkOptions
) -> tuple[np.ndarray, np.ndarray]:
    """Predict the log ratio of a photo and its diffuse layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    network : LayerNetwork
    options : NetworkOptions

    Returns
    -------
    y : (H, W, 3) float32 ndarray
        Not negative, 0 outside the mask.
    b : (H, W) float32 ndarray
        Its error, greater than 0; 0 outside the mask.
    """
    box = mask_slices(mask)
    prepared = standardise_input(image, mask, options.long_side)
    raw, log_error = network(prepared.image, prepared.mask, options.mirrored)
    error = np.exp(log_error)
    excess = np.maximum(raw - options.doubt * error[..., None], 0)
    predicted = np.concatenate([excess, error[..., None]], axis=2)[prepared.place]
    full = np.zeros((*mask.shape, 4), np.float32)
    full[box] = np.where(
        mask[box][..., None],
        _upsampled(predicted, prepared.inside, mask[box].shape, prepared.factor),
        0,
    )
    return full[..., :3], full[..., 3]


def _upsampled(
    predicted: np.ndarray, inside: np.ndarray, shape: tuple[int, ...], factor: float
) -> np.ndarray:
    """Maps (h, w, C), valid where `inside` (h, w), upsampled bilinearly to `shape`."""
    if factor == 1:
        return predicted
    return enlarged(
        np.where(inside[..., None], predicted, masked_gaussian(predicted, inside, 1.0)),
        shape,
        1 / factor,
    )
