"""The network that tells the diffuse layer of a photo from experience: what rendered glossy objects
look like with and without gloss.

Problem: a highlight on grey paint has the paint's own colour; what gives it away is its form, how
it lies on the shape, and what the paint is around it. No local cue is proof; a network that has
seen many objects weighs them all, near and far.

Equation: y_c(x) = log(I_c / D_c) >= 0 and log b(x), the scale of y's error, from log(I / mean I +
.03) and the mask. An encoder of five levels, each of two 3 x 3 convolutions with max(0, .), average_pool
by averages of 2 x 2; a decoder that goes back up with the encoder's layers beside it. Pixels go in
and come out in blocks of 2 x 2 (space to depth), and y = log(1 + exp(o - 2)). The answers for the
photo and its mirror image are averaged. How coloured the light may be that is taken off so: see
`light_tint`.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28; blocks of pixels: W. Shi et al. 2016, doi:10.1109/CVPR.2016.207.
Weights, training scenes and loss are our own: `python -m training.networks.layer_network`.

Limits: it knows lamps, panels and skies on opaque objects of one piece. What no colour and no form
tells (a veil over everything) stays.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..imaging.area_resize import averaged_object
from ..imaging.bounding_box import mask_slices
from ..imaging.smoothing import masked_gaussian
from ..imaging.upsampling import enlarged
from .layers import BLOCK, conv_block, convolved, depth_to_space, encoded, pad_to_stride
from .loader import Network, Parameters

_MARGIN = 2.0  # of the output: without evidence it says "hardly anything"
_CHANNELS = 4  # y of three colours, log b


@dataclass(frozen=True)
class NetworkOptions:
    """`long_side`: of the object, in pixels, as the network sees it, >= 32. `doubt` >= 0: how many
    scales of error y has to exceed. `tint` >= 1: how coloured the light may be that is taken off,
    see `light_tint`. `mirrored`: whether the answer is the mean of those for the photo and its
    mirror image, in twice the time.
    """

    long_side: int = 176
    doubt: float = 0.5
    tint: float = 1.5
    mirrored: bool = True


@dataclass(frozen=True)
class LayerNetwork(Network):
    """`weights`: of each convolution (9, inputs, outputs) float32, rows of the 3 x 3 first;
    `biases` (outputs,). In the order of the data: two for each level down, two for each level up
    from the coarsest, the output.
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
        """Build the network; raise `InputError` if the parameters do not fit."""
        return cls(parameters.weights, parameters.biases)

    @property
    def encoder(self) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """The weights and biases of its levels down."""
        return self.weights[: 2 * self._levels], self.biases[: 2 * self._levels]

    @property
    def _levels(self) -> int:
        return (len(self.weights) - 1) // 4 + 1

    def __call__(
        self, image: np.ndarray, mask: np.ndarray, mirrored: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """y (H, W, 3) >= 0 and log b (H, W), float32, of `image` (H, W, 3) linear >= 0 and `mask`
        (H, W) bool; H, W multiples of 32.

        `mirrored`: see `NetworkOptions`.
        """
        raw = self._run(image, mask)
        if mirrored:
            raw = 0.5 * (raw + self._run(image[:, ::-1], mask[:, ::-1])[:, ::-1])
        return raw[..., :3], raw[..., 3]

    def _run(self, image: np.ndarray, mask: np.ndarray) -> np.ndarray:
        steps = iter(zip(self.weights, self.biases, strict=True))
        kept = encoded(image, mask, steps, self._levels)
        layer = kept[-1]
        for skipped in kept[-2::-1]:
            layer = conv_block(
                np.concatenate([skipped, layer.repeat(2, axis=0).repeat(2, axis=1)], axis=2), steps
            )
        raw = depth_to_space(convolved(layer, *next(steps)))
        raw[..., :3] = np.logaddexp(0, raw[..., :3] - np.float32(_MARGIN))
        return raw


def log_ratio(
    image: np.ndarray, mask: np.ndarray, network: LayerNetwork, options: NetworkOptions
) -> tuple[np.ndarray, np.ndarray]:
    """y (H, W, 3) >= 0 and b (H, W) > 0, float32, 0 outside `mask` (H, W) bool, of `image` (H, W,
    3).
    """
    box = mask_slices(mask)
    small, inside, factor = averaged_object(image, mask, options.long_side)
    (light, cover), place = pad_to_stride(small, inside)
    raw, log_error = network(light, cover, options.mirrored)
    error = np.exp(log_error)
    excess = np.maximum(raw - options.doubt * error[..., None], 0)
    found = np.concatenate([excess, error[..., None]], axis=2)[place]
    whole = np.zeros((*mask.shape, 4), np.float32)
    whole[box] = np.where(mask[box][..., None], _carried(found, inside, mask[box].shape, factor), 0)
    return whole[..., :3], whole[..., 3]


def _carried(
    found: np.ndarray, known: np.ndarray, shape: tuple[int, ...], factor: float
) -> np.ndarray:
    """Maps (h, w, C), `known` (h, w) bool, at the pixels of a picture of `shape`: linear between
    pixels' centres.
    """
    if factor == 1:
        return found
    return enlarged(
        np.where(known[..., None], found, masked_gaussian(found, known, 1.0)), shape, 1 / factor
    )
