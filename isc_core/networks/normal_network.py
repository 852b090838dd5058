"""Prediction of an object's normal map, before the light is known.

Problem: shading alone does not separate concave from convex, nor the depth of either; silhouettes,
highlights and shadows help people, and so does having seen many objects. SIRFS knows the shading
and the silhouette only.

Equation: an encoder of convolutions (`networks.layers`) computes feature maps of the photo, each
half as fine as the one before; a decoder goes back up to cells of 4 x 4 pixels with the encoder's
maps beside it; one more convolution gives, for each cell,

    m (3,), the mean of the unit normals that are likely there,
    log s, the logarithm of the deviation of n_x and n_y from it,

averaged over the photo and its mirror image. `sirfs.normal_prior` turns them into a prior.

Citation: D. Eigen and R. Fergus, "Predicting depth, surface normals and semantic labels with a
common multi-scale convolutional architecture", ICCV 2015, doi:10.1109/ICCV.2015.304 (normals of a
network); O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28 (encoder and decoder). Weights, training pictures and loss are our
own: `python -m training.networks.normal_network`.

Limits: measured in docs/methods/normal_network.md. It was trained on rendered glossy surfaces, and
resolves nothing finer than a thirtieth of the object.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..errors import InputError
from ..imaging.bounding_box import mask_slices
from ..imaging.upsampling import enlarged
from ..scene.normal_estimate import NormalEstimate
from .layers import conv_block, convolved, encoded, is_encoder
from .loader import Network, Parameters
from .network_input import standardise_input

LONG_SIDE = 112  # of the object in the network's input, in pixels
CELL = 4
MIN_LOG_DEVIATION, MAX_LOG_DEVIATION = -4.0, 1.0  # bounds of the logarithm of the deviation
_CHANNELS = 4  # m, log s
_MIN_COVERAGE = 0.02  # least coverage of a cell that is used


@dataclass(frozen=True)
class NormalNetwork(Network):
    """A network for normals. Raises `InputError` where parts do not fit each other.

    Attributes
    ----------
    weights : tuple of (9, inputs, outputs) float32 ndarray
        In the order of the data: two for each of D levels down, two for each of D - 2 levels up
        from the coarsest, the output.
    biases : tuple of (outputs,) float32 ndarray
    """

    title = "normal network"
    file = "normal_network.npz"

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        if len(self.weights) % 4 != 1 or len(self.weights) < 9 or not self._fits():
            raise InputError("these are not the weights of a normal network")

    @property
    def _depth(self) -> int:
        return (len(self.weights) + 3) // 4

    def _fits(self) -> bool:
        down = 2 * self._depth
        if not is_encoder(self.weights[:down], self.biases[:down]):
            return False
        wide = [w.shape[2] for w in self.weights[1:down:2]]
        shapes, inputs = [], wide[-1]
        for skip in wide[-2:0:-1]:
            shapes += [(9, skip + inputs, skip), (9, skip, skip)]
            inputs = skip
        shapes.append((9, inputs, _CHANNELS))
        return [w.shape for w in self.weights[down:]] == shapes and [
            b.shape for b in self.biases[down:]
        ] == [s[2:] for s in shapes]

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> "NormalNetwork":
        """Build the network.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        NormalNetwork

        Raises
        ------
        InputError
            If the parameters do not fit.
        """
        return cls(parameters.weights, parameters.biases)

    def __call__(self, image: np.ndarray, mask: np.ndarray) -> np.ndarray:
        """Return m and log s, (H / 4, W / 4, 4) float32, for an input of `standardise_input`."""
        steps = iter(zip(self.weights, self.biases, strict=True))
        skips = encoded(image, mask, steps, self._depth)
        layer = skips[-1]
        for skip in skips[-2:0:-1]:
            layer = conv_block(
                np.concatenate([skip, layer.repeat(2, axis=0).repeat(2, axis=1)], axis=2), steps
            )
        return convolved(layer, *next(steps))


def predict_normals(
    image: np.ndarray, mask: np.ndarray, network: NormalNetwork | None = None
) -> NormalEstimate:
    """Predict the normal map of a photo.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask.
    mask : (H, W) bool ndarray
    network : NormalNetwork, optional
        By default the shipped one.

    Returns
    -------
    NormalEstimate
    """
    box = mask_slices(mask)
    prepared = standardise_input(image, mask, LONG_SIDE)
    light, cover = prepared.image, prepared.mask
    predict = network or NormalNetwork.shipped()
    predicted = 0.5 * (
        predict(light, cover)
        + predict(light[:, ::-1], cover[:, ::-1])[:, ::-1] * np.array([-1, 1, 1, 1], np.float32)
    )
    upsampled = enlarged(_extrapolated(predicted, cover), cover.shape, CELL)[prepared.place]
    full = np.zeros((*mask.shape, _CHANNELS), np.float32)
    full[box] = (
        upsampled
        if prepared.factor == 1
        else enlarged(upsampled, mask[box].shape, 1 / prepared.factor)
    )
    deviation = np.exp(np.clip(full[..., 3], MIN_LOG_DEVIATION, MAX_LOG_DEVIATION))
    return NormalEstimate(np.where(mask[..., None], full[..., :3], 0), np.where(mask, deviation, 0))


def _extrapolated(cells: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Values of the cells (h, w, C) on `mask` (4 h, 4 w), extrapolated from the nearest of them
    elsewhere.
    """
    rows, columns = cells.shape[:2]
    covered = mask.reshape(rows, CELL, columns, CELL).mean(axis=(1, 3)) > _MIN_COVERAGE
    nearest = ndimage.distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return np.asarray(cells[tuple(nearest)])
