"""Relief finer than a solve resolves, from the photo's fine changes of brightness.

Problem: a fine change of brightness is paint or relief. Relief changes brightness as the light
says, along the light's direction, and not the colour; paint has edges, and hues of its own.

Equation: for slopes p, q of a smooth surface under known light, relief r changes log shading by

    g . grad r,   g = (d log S / dp, d log S / dq).

Of all slopes that explain a change of log shading d, g d / |g|^2 are the smallest. A convolutional
network (`encoder_decoder`) sees them (with |g|^2 + .15^2 below), the photo's logarithm without its
low frequencies, p and q, g, and what the object as a whole says of relief
(`shading.relief_evidence`), and returns the finest band of r: what an image of half the size
cannot hold,

    band(r) = r - U P r

with P the mean of 2 x 2 pixels and U linear interpolation. It is fitted to squared errors of the
slope, so where paint and relief look alike it returns their mean, near 0.

Citation: linear shape from shading: A. Pentland, "Linear shape from shading", IJCV 4, 1990,
doi:10.1007/BF00054993; O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28. Weights, patches and loss are our own: `python -m
training.detail.detail_network`.

Limits: measured in docs/methods/detail.md. It knows no cast shadows.
"""

from dataclasses import dataclass

import numpy as np

from ..imaging.blocks import block_means
from ..imaging.tiles import Place
from .encoder_decoder import EncoderDecoder
from .layers import space_to_depth
from .loader import Parameters

INPUTS = 12
LEVELS, BLOCK = 3, 2  # pixels go in and come out in blocks
MULTIPLE = BLOCK * 2 ** (LEVELS - 1)  # sides of the network's frame
REACH = 80  # pixels, a multiple: what a value of the relief depends on is nearer
BOUND = 64.0  # of the values of layers, which are below 17 on photos
TILE = 768  # pixels of a tile's side, without what is around it, where memory suffices
DARK = 0.01  # of the mean light
COARSE = 8  # pixels: low frequencies are averages of so many
WEAK = 0.15  # a gain below which slopes are not told
STEEPEST = 3.0  # slopes and gains are bounded by it
HEIGHT_UNIT = 0.5  # pixels of height: a unit of the network's output


@dataclass(frozen=True)
class DetailNetwork(EncoderDecoder):
    """The detail network; it has `LEVELS` levels down."""

    title = "detail network"
    file = "detail_network.npz"
    inputs, outputs, block, bound = INPUTS, 1, BLOCK, BOUND

    def fits(self) -> bool:
        """Return whether the parts fit each other."""
        return super().fits() and self.depth == LEVELS

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> "DetailNetwork":
        """Build the network.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        DetailNetwork

        Raises
        ------
        InputError
            If the parameters do not fit.
        """
        return cls(parameters.weights, parameters.biases)

    def __call__(self, channels: np.ndarray) -> np.ndarray:
        """Predict relief.

        Parameters
        ----------
        channels : (H, W, INPUTS) ndarray
            See `channels_of`; sides are multiples of `MULTIPLE`.

        Returns
        -------
        (H, W) float32 ndarray
            Heights, pixels toward the viewer, before `band`.
        """
        return HEIGHT_UNIT * self.walked(channels)[0][..., 0]


def predict_relief(
    image: np.ndarray,
    mask: np.ndarray,
    slope: np.ndarray,
    gain: np.ndarray,
    belief: float,
    network: DetailNetwork | None = None,
) -> np.ndarray:
    """Predict the finest band of the relief in a photo.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear diffuse light over the object's mean; sides are multiples of `MULTIPLE`.
    mask : (H, W) bool ndarray
        The object.
    slope : (H, W, 2) ndarray
        Of the smooth surface: dz/dx, dz/dy, x right, y down, z toward the viewer.
    gain : (H, W, 2) ndarray
        Derivatives of log shading by these slopes.
    belief : float
        What the object's fine changes are: -1 paint, 0 unknown, 1 relief.
    network : DetailNetwork, optional
        By default the shipped one.

    Returns
    -------
    (H, W) ndarray
        Pixels toward the viewer; 0 outside of the mask, and without what half the size can hold.
    """
    network = network or DetailNetwork.shipped()
    # Channels are handed over and not kept: they take more room than the photo.
    maps, _ = network.walked_blocks(
        space_to_depth(channels_of(image, mask, slope, gain, belief), BLOCK)
    )
    relief = HEIGHT_UNIT * maps[..., 0]
    return np.where(mask, band(np.where(mask, relief, 0)), 0)


def band(height: np.ndarray) -> np.ndarray:
    """Return what an image of half the size cannot hold of a height map.

    Parameters
    ----------
    height : (H, W) ndarray
        H and W even.

    Returns
    -------
    (H, W) ndarray
    """
    return height - raised(block_means(height, 2))


def raised(values: np.ndarray) -> np.ndarray:
    """Interpolate maps linearly to twice the size.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray

    Returns
    -------
    (2 H, 2 W) or (2 H, 2 W, C) ndarray
    """
    return _raised_rows(_raised_rows(values).swapaxes(0, 1)).swapaxes(0, 1)


def raised_at(values: np.ndarray, place: Place) -> np.ndarray:
    """Return a part of `raised`.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
    place : tuple of slice
        Rows and columns of the result, with even ends.

    Returns
    -------
    (n, m) or (n, m, C) ndarray
    """
    wide = tuple(slice(max(one.start // 2 - 1, 0), one.stop // 2 + 1) for one in place)
    rows, columns = (
        slice(one.start - 2 * near.start, one.stop - 2 * near.start)
        for one, near in zip(place, wide, strict=True)
    )
    return raised(values[wide])[rows, columns]


def _raised_rows(values: np.ndarray) -> np.ndarray:
    padded = np.concatenate([values[:1], values, values[-1:]])
    out = np.empty((2 * len(values), *values.shape[1:]), values.dtype)
    near = 0.75 * values
    out[0::2] = near + 0.25 * padded[:-2]
    out[1::2] = near + 0.25 * padded[2:]
    return out


def channels_of(
    image: np.ndarray, mask: np.ndarray, slope: np.ndarray, gain: np.ndarray, belief: float
) -> np.ndarray:
    """Return the channels of the first layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, over the object's mean; sides are multiples of `MULTIPLE`.
    mask : (H, W) bool ndarray
    slope, gain : (H, W, 2) ndarray
    belief : float
        See `predict_relief`.

    Returns
    -------
    (H, W, INPUTS) float32 ndarray
        Log light without low frequencies: mean of the channels, red and blue less green; low
        frequencies of the mean; mask; the normal's x and y; gains; the smallest slopes that explain
        the mean; the belief. All are 0 outside of the mask.
    """
    inside = mask.astype(np.float32)
    light = np.where(mask[..., None], image, 0).astype(np.float32)
    log_light = np.log(light + np.float32(DARK))
    parts = [log_light.mean(axis=2), *(log_light[..., c] - log_light[..., 1] for c in (0, 2))]
    cover = _spread(block_means(inside, COARSE))
    low = [_spread(block_means(part * inside, COARSE)) / np.maximum(cover, 1e-6) for part in parts]
    p, q = slope[..., 0], slope[..., 1]
    length = np.sqrt(1 + p * p + q * q)
    bound = np.clip(gain, -STEEPEST, STEEPEST)
    change = (parts[0] - low[0]) / ((bound * bound).sum(axis=2) + WEAK**2)
    least = np.clip(bound * change[..., None], -STEEPEST, STEEPEST)
    found = np.empty((*mask.shape, INPUTS), np.float32)
    for k, (part, smooth) in enumerate(zip(parts, low, strict=True)):
        found[..., k] = (part - smooth) * inside
    found[..., 3], found[..., 4] = low[0] * inside, inside
    found[..., 5], found[..., 6] = -p / length * inside, -q / length * inside
    found[..., 7:9], found[..., 9:11] = bound * inside[..., None], least * inside[..., None]
    found[..., 11] = np.float32(belief) * inside
    return found


def _spread(values: np.ndarray) -> np.ndarray:
    for _ in range(COARSE.bit_length() - 1):
        values = raised(values)
    return values
