"""The network that finds the object in a photo.

Problem: a photo of an object in front of a room or a table has no mask. Colours alone do not
separate the object from its surroundings. The method has to recognise what stands in front, forms
one piece, and casts its own shadow.

Equation: an encoder of convolutions computes feature maps of the photo, each half as fine as the
one before; a decoder with skip connections predicts the log odds that each pixel belongs to the
object (`encoder_decoder`). Means and maxima of the coarsest feature maps give the log odds of none,
one and several objects. The predictions for the photo and its mirror image are averaged. Hints are
drawn into channels of their own: points on the object, points on the background, a box. A logistic
regression on held-out photos gives the confidence (`masking.confidence`).

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28; hints as channels: N. Xu et al., "Deep interactive object
selection", CVPR 2016, doi:10.1109/CVPR.2016.47; confidence: J. Platt, "Probabilistic outputs for
support vector machines", 1999. Weights, training images and losses are our own: `python -m
training.masks.mask_network`.

Limits: measured in docs/methods/automatic_mask.md. Photos are downsampled to a length of 96 pixels.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from .encoder_decoder import PhotoNetwork
from .layers import DARK, frame_coordinates, softmax

SIDE = 96  # side of the network's frame, pixels
INPUTS = 9
POINT_RADIUS = 2.5  # radius of the disc of a point, pixels
COARSE = 2  # number of levels, the coarsest ones, that the number of objects is predicted from
FEATURES = 6  # number of features of the confidence, see `masking.confidence`
_EPSILON = 1e-6


class Count(IntEnum):
    """How many objects a photo shows."""

    NONE = 0
    ONE = 1
    SEVERAL = 2


@dataclass(frozen=True)
class MaskNetwork(PhotoNetwork):
    """The mask network; its global prediction is the log odds of `Count`."""

    title = "mask network"
    file = "mask_network.npz"
    inputs, outputs, coarse, global_outputs = INPUTS, 1, COARSE, len(Count)
    stored = "count", "sureness"  # the names in trained archives

    @property
    def confidence_weights(self) -> np.ndarray:
        """Weights (FEATURES,) of the log odds of a correct mask, see `masking.confidence`."""
        return self.calibration

    def fits(self) -> bool:
        """Return whether the shapes of the parts match."""
        return super().fits() and self.calibration.shape == (FEATURES,)

    def __call__(self, photos: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Predict masks and numbers of objects.

        Parameters
        ----------
        photos : (N, H, W, INPUTS) ndarray
            See `channels_of`. Sides are multiples of 32.

        Returns
        -------
        odds : (N, H, W) float32 ndarray
            Log odds of the object.
        counts : list of (3,) ndarray
            Log odds of `Count`, for each photo.
        """
        maps, levels = self.forward(photos)
        features = []
        for layers in levels[-COARSE:]:
            values = layers.astype(np.float64)
            features += [values.mean(axis=(1, 2)), values.max(axis=(1, 2))]
        counts = [self.predict_global(list(own)) for own in zip(*features, strict=True)]
        return maps[..., 0], counts


@dataclass(frozen=True, eq=False)
class MaskPrediction:
    """The network's prediction for a photo.

    Attributes
    ----------
    cover : (H, W) float32 ndarray
        Probability of the object at each pixel of the frame; 0 outside the photo.
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
        1 inside the photo.
    hints : (side, side, 3) ndarray
        See `channels_of`.
    network : MaskNetwork, optional
        By default the shipped one.

    Returns
    -------
    MaskPrediction
        The prediction for the mirrored photo is the mirror image.
    """
    network = network or MaskNetwork.shipped()
    direct = channels_of(light, frame, hints)
    mirrored = channels_of(light[:, ::-1], frame[:, ::-1], hints[:, ::-1])
    both, counts = network(np.stack([direct, mirrored]))
    odds = (both[0] + both[1][:, ::-1]) / 2
    cover = np.where(frame, 1 / (1 + np.exp(-np.clip(odds, -30, 30))), 0)
    return MaskPrediction(cover.astype(np.float32), softmax((counts[0] + counts[1]) / 2))


def channels_of(light: np.ndarray, frame: np.ndarray, hints: np.ndarray) -> np.ndarray:
    """Return the channels of the first layer.

    Parameters
    ----------
    light : (H, W, 3) ndarray
        Linear.
    frame : (H, W) bool ndarray
        1 inside the photo.
    hints : (H, W, 3) ndarray
        1 on points of the object, on points of the background, in the box; else 0.

    Returns
    -------
    (H, W, INPUTS) float32 ndarray
        Log light over the photo's mean, the frame, the coordinates of `frame_coordinates`, and the
        hints. All are 0 outside the photo.
    """
    inside = frame[..., None].astype(np.float32)
    place = frame_coordinates(*frame.shape)
    light = np.where(frame[..., None], light, 0).astype(np.float32)
    # Sums of columns are added in pairs that mirroring exchanges, so that the mirrored photo has
    # the same mean to the last bit.
    columns = light.sum(axis=(0, 2), dtype=np.float64)
    mean = float((columns + columns[::-1]).sum()) / (6 * max(int(frame.sum()), 1))
    log_light = np.log(light / np.float32(max(mean, _EPSILON)) + np.float32(DARK))
    return np.concatenate(
        [log_light * inside, inside, place * inside, hints.astype(np.float32) * inside], axis=2
    )
