"""Classification of a photo's bright details as highlights or paint.

Problem: colour identifies a highlight on saturated paint, but not on white, grey or black. There,
people use shape cues: a highlight is peaked, follows the surface, and crosses the paint.

Equation: with m the smallest channel, its bright details b_k by size (`imaging.brightness_bands`)
contain nearly all of a visible highlight, and all white print. A convolutional encoder-decoder
(`encoder_decoder`) receives the photo and the b_k, and predicts for each pixel and size the log
odds o_k that the detail is specular light:

    s = sum_k b_k / (1 + exp(-o_k)).

The predictions for the photo and its mirror image are averaged. On photos of a higher resolution
than the network's frame, the b_k are computed from the photo, at sizes scaled accordingly, so that
edges are those of the photo.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28. Weights, training images and losses are our own: `python -m
training.networks.highlight_network`.

Limits: measured in docs/methods/highlight_network.md. Specular light without bright details, such
as broad sheen over the whole object, is not detected. The light is assumed to be white.
"""

from dataclasses import dataclass

import numpy as np

from ..imaging.brightness_bands import brightness_bands
from ..imaging.channels import largest, smallest
from ..imaging.smoothing import masked_gaussian
from .encoder_decoder import EncoderDecoder
from .frame import at_full_size, framed
from .layers import DARK
from .scene_network import LONG_SIDE, SIDE
from .scene_network import channels_of as photo_channels_of

REACHES = (2, 5, 11)  # sizes of details, pixels of a frame of `SIDE`
INPUTS = 7 + len(REACHES)
_SMOOTH = 0.35  # pixels of the frame: suppresses bright details of noise
_LARGEST_ODDS = 30.0  # logarithm
_EPSILON = 1e-6


class HighlightNetwork(EncoderDecoder):
    """The highlight network."""

    title = "highlight network"
    file = "highlight_network.npz"
    inputs, outputs = INPUTS, len(REACHES)


@dataclass(frozen=True, eq=False)
class HighlightPrediction:
    """The network's prediction of a photo's highlights.

    Attributes
    ----------
    specular : (H, W) float32 ndarray
        s, equal in all channels; at most the photo's smallest channel, 0 outside the mask.
    deviation : (H, W) float32 ndarray
        Standard deviation of s: with p_k = 1 / (1 + exp(-o_k)), sqrt(sum_k b_k^2 p_k (1 - p_k)).
    share : (H, W) float32 ndarray
        s over the sum of the b_k, in [0, 1]; 0 where there are no details.
    """

    specular: np.ndarray
    deviation: np.ndarray
    share: np.ndarray


def predict_highlights(
    image: np.ndarray,
    mask: np.ndarray,
    log_odds_margin: float = 0.0,
    network: HighlightNetwork | None = None,
) -> HighlightPrediction:
    """Predict the highlights of a photo.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask.
    mask : (H, W) ndarray of bool
    log_odds_margin : float
        Subtracted from the log odds.
    network : HighlightNetwork, optional
        By default the shipped one.

    Returns
    -------
    HighlightPrediction
        Equivariant: the prediction for a mirrored photo is mirrored.
    """
    network = network or HighlightNetwork.shipped()
    frame = framed(image, mask, SIDE, LONG_SIDE)
    direct = channels_of(frame.image, frame.mask)
    mirrored = channels_of(frame.image[:, ::-1], frame.mask[:, ::-1])
    both, _ = network.forward(np.stack([direct, mirrored]))
    odds = at_full_size((both[0] + both[1][:, ::-1]) / 2, frame, mask)
    scale = 1 / frame.factor
    values = smallest_channel = smallest(np.where(mask[..., None], image, 0)).astype(np.float32)
    if scale > 1:
        values = masked_gaussian(values, mask, _SMOOTH * scale)
    light, details, variance = (np.zeros_like(values) for _ in range(3))
    reaches = [max(1, round(reach * scale)) for reach in REACHES]
    for k, band in enumerate(brightness_bands(values, mask, reaches)):
        exponent = np.clip(log_odds_margin - odds[..., k], -_LARGEST_ODDS, _LARGEST_ODDS)
        probability = 1 / (1 + np.exp(exponent))
        light += band * probability
        details += band
        variance += np.square(band) * (probability * (1 - probability))
    share = light / np.maximum(details, _EPSILON * max(float(values.max()), _EPSILON))
    return HighlightPrediction(np.minimum(light, smallest_channel), np.sqrt(variance), share)


def channels_of(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the channels of the first layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, 0 outside the mask.
    mask : (H, W) ndarray of bool

    Returns
    -------
    (H, W, INPUTS) float32 ndarray
        The channels of the scene network, log(1 + b_k / (.03 mean light)), and log(C / mean light +
        .03) with the chroma C, the largest minus the smallest channel.
    """
    photo = photo_channels_of(image, mask)
    mean = float(image[mask].mean(dtype=float)) if mask.any() else 0.0
    values = smallest(image).astype(np.float32)
    bands = np.stack(list(brightness_bands(values, mask, REACHES)), axis=2)
    unit = np.float32(max(mean, _EPSILON))
    details = np.log1p(bands / (np.float32(DARK) * unit))
    chroma = np.log((largest(image) - values) / unit + np.float32(DARK)) * mask
    return np.concatenate([photo, details, chroma[..., None]], axis=2, dtype=np.float32)
