"""The trainable mask network and its loss; the counterpart of `isc_core.networks.mask_network`.

Equation: with the log odds o of a pixel, p = 1 / (1 + exp(-o)) and the true coverage a,

    mean of -a log p - (1 - a) log(1 - p), weighted by 4 near the outline
    + 1 - sum (2 a p) / sum (a + p)                                   (where there is an object)
    + .3 (cross entropy of the number of objects)

Citation: overlap as a loss: F. Milletari, N. Navab, S.-A. Ahmadi, "V-Net", 3DV 2016,
doi:10.1109/3DV.2016.79.

Limits: none of its own.
"""

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.networks.encoder_decoder import BLOCK
from isc_core.networks.layers import DARK
from isc_core.networks.mask_network import COARSE, FEATURES, INPUTS, Count

from ..networks.blocks import load_arrays, stored_arrays
from ..networks.encoder_decoder import EncoderDecoderModule, start_small
from .composites import Composite

DOWN, UP = (64, 128, 192, 96), (96, 96, 64)
HIDDEN = 64
_OUTLINE = 3.0  # weight of pixels near the outline
_COUNT, _OVERLAP = 0.3, 1.0


class MaskNetworkModule(EncoderDecoderModule):
    """The trainable mask network.

    Parameters
    ----------
    down, up : tuple of int
        Channels of the levels down, the finest first, and up, the coarsest first.
    """

    def __init__(self, down: tuple[int, ...] = DOWN, up: tuple[int, ...] = UP) -> None:
        super().__init__(INPUTS, 1, down, up, BLOCK)
        self.hidden = nn.Linear(2 * sum(down[-COARSE:]), HIDDEN)
        self.count = nn.Linear(HIDDEN, len(Count))
        nn.init.kaiming_normal_(self.out.weight, nonlinearity="relu")
        start_small(self.out, self.count)
        self.to(memory_format=torch.channels_last)

    def forward(self, inputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Predict the mask and the number of objects.

        Parameters
        ----------
        inputs : (B, INPUTS, side, side) tensor
            See `network_channels`.

        Returns
        -------
        odds : (B, 1, side, side) tensor
        counts : (B, 3) tensor
            As `MaskNetwork` returns them.
        """
        odds, levels = self.encoded_and_decoded(inputs)
        coarse = [layer.float() for layer in levels[-COARSE:]]
        features = [part for layer in coarse for part in (layer.mean((2, 3)), layer.amax((2, 3)))]
        return odds, self.count(functional.relu(self.hidden(torch.cat(features, 1))))

    def loss(self, batch: Composite) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch and its terms.

        Parameters
        ----------
        batch : Composite

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            Not weighted; "iou" is the mean overlap of objects with their masks, "right" the
            fraction of correct counts.
        """
        odds, counts = self(network_channels(batch))
        truth, frame = batch.mask, batch.frame
        outline = functional.max_pool2d(truth, 5, 1, 2) + functional.max_pool2d(-truth, 5, 1, 2)
        weight = frame * (1 + _OUTLINE * outline)
        entropy = functional.binary_cross_entropy_with_logits(odds, truth, reduction="none")
        entropy = ((entropy * weight).sum((1, 2, 3)) / weight.sum((1, 2, 3))).mean()
        cover = torch.sigmoid(odds) * frame
        shown = (truth.sum((1, 2, 3)) > 0).float()
        both = (2 * cover * truth).sum((1, 2, 3))
        overlap = both / (cover + truth).sum((1, 2, 3)).clamp(min=1)
        count = functional.cross_entropy(counts, batch.count)
        total = entropy + _OVERLAP * ((1 - overlap) * shown).mean() + _COUNT * count
        with torch.no_grad():
            found, true = (cover > 0.5).float(), (truth > 0.5).float()
            iou = (found * true).sum((1, 2, 3)) / (found + true).clamp(max=1).sum((1, 2, 3)).clamp(
                min=1
            )
            right = (counts.argmax(1) == batch.count).float().mean()
        terms = {
            "entropy": entropy,
            "iou": (iou * shown).sum() / shown.sum().clamp(min=1),
            "count": count,
            "right": right,
        }
        return total, terms

    @property
    def _dense(self) -> dict[str, nn.Linear]:
        return {"hidden": self.hidden, "count": self.count}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""
        found = stored_arrays(self.pairs, self.out, self._dense)
        found["sureness"] = np.eye(FEATURES, dtype=np.float32)[1]
        return found

    def load_arrays(self, arrays: dict[str, np.ndarray]) -> None:
        """Load weights in the layout of the core.

        Parameters
        ----------
        arrays : dict of str to ndarray
            As `arrays` returns them.
        """
        load_arrays(self.pairs, self.out, self._dense, arrays)


def network_channels(batch: Composite) -> torch.Tensor:
    """Return the input channels; equal to `isc_core.networks.mask_network.channels_of`.

    Parameters
    ----------
    batch : Composite

    Returns
    -------
    (B, INPUTS, H, W) tensor
    """
    photo, frame = batch.photo, batch.frame
    rows, columns = photo.shape[2:]
    right = (torch.arange(columns, device=photo.device) + 0.5) * (2 / columns) - 1
    up = 1 - (torch.arange(rows, device=photo.device) + 0.5) * (2 / rows)
    mean = (photo.mean(1, keepdim=True) * frame).sum((2, 3), keepdim=True)
    mean = (mean / frame.sum((2, 3), keepdim=True).clamp(min=1)).clamp(min=1e-6)
    light = torch.log(photo / mean + DARK) * frame
    return torch.cat([light, frame, right * frame, up[:, None] * frame, batch.hints * frame], 1)
