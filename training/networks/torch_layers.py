"""PyTorch counterparts of `isc_core.networks.layers`: same inputs, same layout of the weights.

Equation: the input is log(I / mean I + 0.03) and the mask.

Citation: K. He et al., "Delving Deep into Rectifiers", 2015, doi:10.1109/ICCV.2015.123 (initial
weights).

Limits: `network_input` must stay equal to `isc_core.networks.layers.inputs_of`.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from torch import nn
from torch.nn import functional

_DARK = 0.03  # as in isc_core.networks.layers


class ConvBlock(nn.Module):  # type: ignore[misc]
    """Two 3 x 3 convolutions, each followed by a ReLU.

    Parameters
    ----------
    inputs, outputs : int
        Channels.
    """

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.c1 = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.c2 = nn.Conv2d(outputs, outputs, 3, padding=1)

    def forward(self, layer: torch.Tensor) -> torch.Tensor:
        """Apply two convolutions, each followed by ReLU.

        Parameters
        ----------
        layer : (B, inputs, H, W) tensor

        Returns
        -------
        (B, outputs, H, W) tensor
        """
        return functional.relu(self.c2(functional.relu(self.c1(layer))))


def initialise(modules: Iterable[nn.Module]) -> None:
    """Set the convolutions' weights as K. He et al. do, and their biases to 0.

    Parameters
    ----------
    modules : iterable of nn.Module
        Those that are not convolutions stay as they are.
    """
    for module in modules:
        if isinstance(module, nn.Conv2d):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
            nn.init.zeros_(module.bias)


def encoder_from(weights: Sequence[np.ndarray], biases: Sequence[np.ndarray]) -> nn.ModuleList:
    """Build the convolutions of a fitted encoder.

    Parameters
    ----------
    weights : sequence of (9, inputs, outputs) ndarray
        In the layout of the core.
    biases : sequence of (outputs,) ndarray
        One per convolution.

    Returns
    -------
    nn.ModuleList
        One `nn.Conv2d` per entry.
    """
    convolutions = nn.ModuleList()
    for weight, bias in zip(weights, biases, strict=True):
        one = nn.Conv2d(weight.shape[1], weight.shape[2], 3, padding=1)
        kernel = weight.reshape(3, 3, *weight.shape[1:]).transpose(3, 2, 0, 1)
        one.weight.data.copy_(torch.from_numpy(kernel.copy()))
        one.bias.data.copy_(torch.from_numpy(bias))
        convolutions.append(one)
    return convolutions


def convolution_arrays(convolutions: Iterable[nn.Conv2d]) -> dict[str, np.ndarray]:
    """Export convolutions in the layout of the core.

    Parameters
    ----------
    convolutions : iterable of nn.Conv2d
        In the order in which the core runs them.

    Returns
    -------
    dict of str to ndarray
        `weightKK` (9, inputs, outputs) and `biasKK` (outputs,), float16.
    """
    found: dict[str, np.ndarray] = {}
    for k, one in enumerate(convolutions):
        weight = one.weight.detach().numpy().transpose(2, 3, 1, 0)
        found[f"weight{k:02d}"] = weight.reshape(9, *weight.shape[2:]).astype(np.float16)
        found[f"bias{k:02d}"] = one.bias.detach().numpy().astype(np.float16)
    return found


def network_input(image: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Standardise photos.

    Parameters
    ----------
    image : (B, 3, H, W) tensor
        Linear light, >= 0.
    mask : (B, 1, H, W) tensor
        1 on the object, 0 elsewhere.

    Returns
    -------
    (B, 4, H, W) tensor
        Log light over the object's mean, 0 outside; and the mask.
    """
    count = mask.sum((2, 3), keepdim=True).clamp(min=1)
    mean = (image.mean(1, keepdim=True) * mask).sum((2, 3), keepdim=True) / count
    return torch.cat([torch.log(image / mean.clamp(min=1e-9) + _DARK) * mask, mask], 1)
