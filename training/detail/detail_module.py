"""The trainable detail network and its loss; the counterpart of `isc_core.networks.detail_network`.

Equation: with the relief's band r, its estimate s, and means over a patch,

    mean |grad s - grad r|^2 / (mean |grad r|^2 + e^2)

so that faint and strong relief count alike, and false relief of paint as that of slope e.

Citation: see `isc_core.networks.detail_network`.

Limits: none of its own.
"""

import numpy as np
import torch
from torch.nn import functional

from isc_core.networks.detail_network import (
    BLOCK,
    COARSE,
    DARK,
    HEIGHT_UNIT,
    INPUTS,
    STEEPEST,
    WEAK,
)

from ..networks.blocks import stored_arrays
from ..networks.encoder_decoder import EncoderDecoderModule, quieten
from .patches import Patch, band_of

DOWN, UP = (32, 48, 64), (48, 32)
_SLOPE = 0.05  # e


class DetailNetworkModule(EncoderDecoderModule):
    """The trainable detail network.

    Parameters
    ----------
    down, up : tuple of int
        Channels of the levels down, the finest first, and up, the coarsest first.
    """

    def __init__(self, down: tuple[int, ...] = DOWN, up: tuple[int, ...] = UP) -> None:
        super().__init__(INPUTS, 1, down, up, BLOCK)
        quieten(self.out)
        self.to(memory_format=torch.channels_last)

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Predict relief.

        Parameters
        ----------
        inputs : (B, INPUTS, H, W) tensor
            See `network_channels`.

        Returns
        -------
        (B, 1, H, W) tensor
            Heights, before `band_of`.
        """
        return HEIGHT_UNIT * self.walked(inputs)[0]

    def loss(self, batch: Patch) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch and its terms.

        Parameters
        ----------
        batch : Patch

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            "left": squared error over relief's energy, of the patches that have relief; "false":
            mean slope of what is not there, of those without.
        """
        mask = batch.mask
        relief = band_of(self(network_channels(batch)) * mask) * mask
        truth = batch.height * mask
        (error, known), (true, _) = (_energy(part, mask) for part in (relief - truth, truth))
        error, energy = (
            part.sum((1, 2, 3)) / known.sum((1, 2, 3)).clamp(min=1) for part in (error, true)
        )
        loss = (error / (energy + _SLOPE**2)).mean()
        with torch.no_grad():
            has = energy > 1e-6
            count = has.float().sum().clamp(min=1)
            ratio = torch.where(has, error / energy.clamp(min=1e-9), 0)
            false = torch.where(has, 0, error).sum() / (~has).float().sum().clamp(min=1)
            terms = {
                "left": (error * has).sum() / (energy * has).sum().clamp(min=1e-9),
                "each": ratio.clamp(max=2).sum() / count,
                "false": false.sqrt(),
            }
        return loss, terms

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""
        return stored_arrays(self.pairs, self.out, {})


def _energy(height: torch.Tensor, mask: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Squared slopes (B, 1, H-1, W-1) by forward differences, and where they are known."""
    known = mask[:, :, 1:, 1:] * mask[:, :, :-1, 1:] * mask[:, :, 1:, :-1]
    right = height[:, :, :-1, 1:] - height[:, :, :-1, :-1]
    down = height[:, :, 1:, :-1] - height[:, :, :-1, :-1]
    known = known * mask[:, :, :-1, :-1]
    return (right.square() + down.square()) * known, known


def network_channels(batch: Patch) -> torch.Tensor:
    """Return the input channels; equal to `isc_core.networks.detail_network.channels_of`.

    Parameters
    ----------
    batch : Patch

    Returns
    -------
    (B, INPUTS, H, W) tensor
    """
    photo, mask = batch.photo, batch.mask
    slope, gain = batch.slope, batch.gain
    log_light = torch.log(photo * mask + DARK)
    parts = torch.cat([log_light.mean(1, keepdim=True), log_light[:, ::2] - log_light[:, 1:2]], 1)
    cover = _low(mask)
    low = _low(parts * mask) / cover.clamp(min=1e-6)
    length = torch.sqrt(1 + slope.square().sum(1, keepdim=True))
    bound = gain.clamp(-STEEPEST, STEEPEST)
    change = (parts - low)[:, :1] / (bound.square().sum(1, keepdim=True) + WEAK**2)
    least = (bound * change).clamp(-STEEPEST, STEEPEST)
    ones = torch.ones_like(mask)
    told = batch.belief * ones
    return torch.cat([parts - low, low[:, :1], ones, -slope / length, bound, least, told], 1) * mask


def _low(values: torch.Tensor) -> torch.Tensor:
    values = functional.avg_pool2d(values, COARSE)
    for _ in range(COARSE.bit_length() - 1):
        values = functional.interpolate(
            values, scale_factor=2, mode="bilinear", align_corners=False
        )
    return values
