"""The trainable highlight network and its loss; see `isc_core.networks.highlight_network`.

Equation: with the bright details b_k of a photo and d_k of its diffuse image, the share of a detail
that is specular is g_k = (b_k - d_k) / b_k, in [0, 1]. With log odds o_k, s = sum_k b_k sigma(o_k),
the true specular light t and the photo I,

    sum_k w_k H(g_k, sigma(o_k)) / sum_k w_k + log(1 + |s - t|^2 / (|t|^2 + 10^-3 |I|^2)) / 2,

H the cross entropy, w_k = b_k / (b_k + .15 mean I). The first term classifies every detail; with
the squared error alone, which depends on few bright pixels, training is ten times slower.

Citation: see `training.networks.scene_module`.

Limits: none of its own.
"""

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.networks.encoder_decoder import BLOCK
from isc_core.networks.highlight_network import INPUTS, REACHES
from isc_core.networks.layers import DARK
from isc_core.networks.scene_network import SIDE

from ..world.samples import Sample
from .blocks import load_arrays, stored_arrays
from .encoder_decoder import EncoderDecoderModule, start_small
from .scene_module import network_channels as photo_channels

DOWN, UP = (64, 128, 192, 96), (64, 64, 48)
_START = -2.0  # log odds: most details are paint
_FAINT = 0.15  # of the mean light: a detail that counts half
_FLOOR = 0.002  # of the weights, so that photos without details have no large ones
_MATT = 1e-3  # of the photo's squares: added to those of the specular light
_ERROR = 0.5
_GLOSSY = 1e-3  # of the photo's squares: from here on a photo counts as glossy in the terms
_FAR = 1e4


class HighlightNetworkModule(EncoderDecoderModule):
    """The trainable highlight network.

    Parameters
    ----------
    down, up : tuple of int
        Channels of the levels down, the finest first, and up, the coarsest first.
    """

    def __init__(self, down: tuple[int, ...] = DOWN, up: tuple[int, ...] = UP) -> None:
        super().__init__(INPUTS, len(REACHES), down, up, BLOCK)
        nn.init.kaiming_normal_(self.out.weight, nonlinearity="relu")
        start_small(self.out)
        nn.init.constant_(self.out.bias, _START)
        self.to(memory_format=torch.channels_last)

    def forward(self, photo: torch.Tensor, mask: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Classify bright details.

        Parameters
        ----------
        photo : (B, 3, side, side) tensor
        mask : (B, 1, side, side) tensor

        Returns
        -------
        odds, bands : (B, 3, side, side) tensor
            Log odds of specular light; the details.
        """
        bands = bands_of(photo, mask)
        odds, _ = self.encoded_and_decoded(network_channels(photo, mask, bands))
        return odds, bands

    def loss(self, batch: Sample) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch and its terms.

        Parameters
        ----------
        batch : Sample

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            Cross entropy and error; of glossy photos the squared error over that of doing nothing;
            of matt ones the share of the light that is taken off.
        """
        photo, known = batch.photo, batch.known
        odds, bands = self(photo, batch.mask)
        with torch.no_grad():
            diffuse = photo * torch.exp(-batch.ratio)
            share = (bands - bands_of(diffuse, batch.mask)) / bands.clamp(min=1e-6)
            weight = bands / (bands + _FAINT * _mean_light(photo, batch.mask)) * known
            true = (photo - diffuse) * known
        entropy = functional.binary_cross_entropy_with_logits(
            odds, share.clamp(0, 1), reduction="none"
        )
        floor = _FLOOR * weight[0].numel()
        entropy = (_sums(entropy * weight) / (_sums(weight) + floor)).mean()
        light = (torch.sigmoid(odds) * bands).sum(1, keepdim=True)
        removed = torch.minimum(light.expand_as(photo), photo) * known
        wrong, squares = _sums((removed - true).square()), _sums(true.square())
        whole = _sums((photo * known).square()).clamp(min=1e-6)
        error = torch.log1p(wrong / (squares + _MATT * whole)).mean()
        with torch.no_grad():
            glossy = (squares > _GLOSSY * whole).float()
            taken = _sums(removed) / _sums(photo * known).clamp(min=1e-6)
            terms = {
                "entropy": entropy,
                "error": error,
                "glossy": _mean(wrong / squares.clamp(min=1e-9), glossy),
                "matt": _mean(taken, (squares == 0).float()),
            }
        return entropy + _ERROR * error, terms

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""
        return stored_arrays(self.pairs, self.out, {})

    def load_arrays(self, arrays: dict[str, np.ndarray]) -> None:
        """Continue from weights in the core's layout.

        Parameters
        ----------
        arrays : dict of str to ndarray
            As `arrays` returns them.
        """
        load_arrays(self.pairs, self.out, {}, arrays)


def _sums(values: torch.Tensor) -> torch.Tensor:
    """Of each photo."""
    return values.sum((1, 2, 3))


def _mean_light(photo: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Of each object (B, 1, 1, 1)."""
    mean = (photo * mask).sum((1, 2, 3), keepdim=True) / 3
    return (mean / mask.sum((1, 2, 3), keepdim=True).clamp(min=1)).clamp(min=1e-6)


def _mean(values: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    return (values * weight).sum() / weight.sum().clamp(min=1)


def network_channels(photo: torch.Tensor, mask: torch.Tensor, bands: torch.Tensor) -> torch.Tensor:
    """Return the input channels; equal to `isc_core.networks.highlight_network.channels_of`.

    Parameters
    ----------
    photo : (B, 3, H, W) tensor
    mask : (B, 1, H, W) tensor
    bands : (B, 3, H, W) tensor

    Returns
    -------
    (B, INPUTS, H, W) tensor
    """
    mean = _mean_light(photo, mask)
    details = torch.log1p(bands / (DARK * mean))
    chroma = photo.amax(1, keepdim=True) - photo.amin(1, keepdim=True)
    chroma = torch.log(chroma / mean + DARK) * mask
    return torch.cat([photo_channels(photo, mask), details, chroma], 1)


def bands_of(photo: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Return the bright details of the smallest channel, as `imaging.brightness_bands` does.

    Parameters
    ----------
    photo : (B, 3, side, side) tensor
        `REACHES` are those of a side of 128 pixels.
    mask : (B, 1, side, side) tensor

    Returns
    -------
    (B, 3, side, side) tensor
    """
    values = photo.amin(1, keepdim=True)
    before, found = values, []
    for reach in REACHES:
        pixels = max(1, round(reach * photo.shape[-1] / SIDE))
        after = torch.minimum(before, _opened(values, mask, pixels))
        found.append((before - after) * mask)
        before = after
    return torch.cat(found, 1)


def _opened(values: torch.Tensor, mask: torch.Tensor, reach: int) -> torch.Tensor:
    low = -_largest(-torch.where(mask > 0, values, _FAR), reach)
    return _largest(torch.where(mask > 0, low, -_FAR), reach)


def _largest(values: torch.Tensor, reach: int) -> torch.Tensor:
    """The largest value in squares: first in columns, then in rows."""
    side = 2 * reach + 1
    tall = functional.max_pool2d(values, (side, 1), 1, (reach, 0))
    return functional.max_pool2d(tall, (1, side), 1, (0, reach))
