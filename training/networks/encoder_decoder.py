"""The trainable encoder and decoder; the counterpart of `isc_core.networks.encoder_decoder`."""

from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.io.npy import read_arrays
from isc_core.networks import scene_network

from ..devices import halves_are_fast
from .blocks import Block, Convolution, restore_first

_QUIET = 0.1
_SCENE = Path(scene_network.__file__).parent / "data" / scene_network.SceneNetwork.file


class EncoderDecoderModule(nn.Module):  # type: ignore[misc]
    """A trainable encoder and decoder.

    Parameters
    ----------
    inputs, outputs : int
        Channels of a pixel.
    down, up : tuple of int
        Channels of the levels down, the finest first, and up, the coarsest first.
    block : int
        Pixels of a block's side.
    """

    def __init__(
        self, inputs: int, outputs: int, down: tuple[int, ...], up: tuple[int, ...], block: int
    ) -> None:
        super().__init__()
        self.block = block
        above = (block**2 * inputs, *down[:-1])
        self.down = nn.ModuleList([Block(i, o) for i, o in zip(above, down, strict=True)])
        below = (down[-1], *up[:-1])
        self.up = nn.ModuleList(
            [Block(skip + i, o) for skip, i, o in zip(down[-2::-1], below, up, strict=True)]
        )
        self.out = nn.Conv2d(up[-1], block**2 * outputs, 3, padding=1)

    def encoded_and_decoded(self, inputs: torch.Tensor) -> tuple[torch.Tensor, list[torch.Tensor]]:
        """Apply encoder and decoder.

        Parameters
        ----------
        inputs : (B, inputs, H, W) tensor

        Returns
        -------
        maps : (B, outputs, H, W) tensor
        levels : list of tensor
            The encoder's maps, the finest first.
        """
        layer = functional.pixel_unshuffle(inputs, self.block).contiguous(
            memory_format=torch.channels_last
        )
        levels: list[torch.Tensor] = []
        half = self.training and halves_are_fast(inputs.device.type)
        with torch.autocast(inputs.device.type, torch.bfloat16, enabled=half):
            for level, block in enumerate(self.down):
                layer = block(functional.avg_pool2d(layer, 2) if level else layer)
                levels.append(layer)
            for block, skip in zip(self.up, levels[-2::-1], strict=True):
                finer = functional.interpolate(layer, scale_factor=2, mode="nearest")
                layer = block(torch.cat([skip, finer], 1))
            maps = functional.pixel_shuffle(self.out(layer), self.block).float()
        return maps, levels

    def begin(self, weights: dict[str, np.ndarray] | None) -> None:
        """Start from weights, or without, from the encoder of the shipped scene network.

        Parameters
        ----------
        weights : dict of str to ndarray or None
            Content of an archive of this network.
        """
        if weights is None:
            self.start_from_scene(read_arrays(_SCENE))
        else:
            self.load_arrays(weights)

    def start_from_scene(self, arrays: dict[str, np.ndarray]) -> None:
        """Start with the scene network's weights of the encoder levels whose channels agree.

        Parameters
        ----------
        arrays : dict of str to ndarray
            Content of the scene network's archive.
        """
        restore_first(self.pairs[: 2 * len(self.down)], arrays)

    def matrices(self) -> list[nn.Parameter]:
        """Return the weights of the blocks."""
        return [convolution.matrix for convolution, _ in self.pairs]

    @property
    def pairs(self) -> list[tuple[Convolution, nn.BatchNorm2d]]:
        """The blocks' convolutions with their normalisations, in the order of the data."""
        return [pair for block in [*self.down, *self.up] for pair in block.pairs]


def start_small(*layers: nn.Conv2d | nn.Linear) -> None:
    """Scale the initial weights of last layers so that first outputs are small.

    Parameters
    ----------
    layers : nn.Module
        With `weight` and `bias`; changed in place.
    """
    for layer in layers:
        nn.init.zeros_(layer.bias)
        layer.weight.data *= _QUIET
