"""Parts that the trainable networks share, and the way of their weights to the core's layout.

Citation: S. Ioffe, C. Szegedy, "Batch normalization", 2015, arXiv:1502.03167; initial weights: K.
He et al. 2015, doi:10.1109/ICCV.2015.123.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.errors import InputError


class Convolution(nn.Module):  # type: ignore[misc]
    """A 3 x 3 convolution without bias, whose weights are one matrix.

    An optimizer of matrices takes the weights as they are; as a kernel they are a view of the
    matrix, channels last.

    Parameters
    ----------
    inputs, outputs : int
        Channels.
    """

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.matrix = nn.Parameter(torch.empty(outputs, 9 * inputs))
        nn.init.kaiming_normal_(self.matrix, nonlinearity="relu")

    @property
    def weight(self) -> torch.Tensor:
        """The kernel (outputs, inputs, 3, 3), a view."""
        return self.matrix.view(len(self.matrix), 3, 3, -1).permute(0, 3, 1, 2)

    def forward(self, layer: torch.Tensor) -> torch.Tensor:
        """Convolve.

        Parameters
        ----------
        layer : (B, inputs, H, W) tensor

        Returns
        -------
        (B, outputs, H, W) tensor
        """
        return functional.conv2d(layer, self.weight, padding=1)


class Block(nn.Module):  # type: ignore[misc]
    """Two 3 x 3 convolutions, each followed by batch normalisation and max(0, .).

    Parameters
    ----------
    inputs, outputs : int
        Channels.
    """

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.c1 = Convolution(inputs, outputs)
        self.n1 = nn.BatchNorm2d(outputs)
        self.c2 = Convolution(outputs, outputs)
        self.n2 = nn.BatchNorm2d(outputs)

    def forward(self, layer: torch.Tensor) -> torch.Tensor:
        """Apply both convolutions.

        Parameters
        ----------
        layer : (B, inputs, H, W) tensor

        Returns
        -------
        (B, outputs, H, W) tensor
        """
        layer = functional.relu(self.n1(self.c1(layer)))
        return functional.relu(self.n2(self.c2(layer)))

    @property
    def pairs(self) -> list[tuple[Convolution, nn.BatchNorm2d]]:
        """The convolutions with their normalisations."""
        return [(self.c1, self.n1), (self.c2, self.n2)]


def folded(one: nn.Conv2d, norm: nn.BatchNorm2d) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the weight and bias of a convolution that does what it and its normalisation do.

    Parameters
    ----------
    one : nn.Module
        With a `weight`.
    norm : nn.BatchNorm2d

    Returns
    -------
    weight, bias : tensor
    """
    gain = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return one.weight * gain[:, None, None, None], norm.bias - gain * norm.running_mean


def norm_state(norm: nn.BatchNorm2d) -> torch.Tensor:
    """Return the four rows of numbers of a normalisation.

    Parameters
    ----------
    norm : nn.BatchNorm2d

    Returns
    -------
    (4, channels) tensor
        Gain, offset, running mean and variance.
    """
    return torch.stack([norm.weight, norm.bias, norm.running_mean, norm.running_var]).detach()


def kernel_of(weight: np.ndarray) -> torch.Tensor:
    """Return weights of the core's layout as a kernel.

    Parameters
    ----------
    weight : (9, inputs, outputs) ndarray

    Returns
    -------
    (outputs, inputs, 3, 3) tensor
    """
    blocks = weight.astype(np.float32).reshape(3, 3, *weight.shape[1:])
    return torch.from_numpy(blocks.transpose(3, 2, 0, 1).copy())


def as_array(values: torch.Tensor) -> np.ndarray:
    """Return a tensor as an array.

    Parameters
    ----------
    values : tensor

    Returns
    -------
    ndarray
    """
    return np.asarray(values.detach().cpu().numpy())


def stored_arrays(
    pairs: Sequence[tuple[Convolution, nn.BatchNorm2d]],
    out: nn.Conv2d,
    dense: Mapping[str, nn.Linear],
) -> dict[str, np.ndarray]:
    """Return the weights of blocks, output and dense layers in the layout that the core reads.

    Parameters
    ----------
    pairs : sequence of (Convolution, BatchNorm2d)
    out : Conv2d
    dense : mapping of str to Linear
        By the names of their arrays.

    Returns
    -------
    dict of str to ndarray
        float16; the state of normalisation is kept beside them to continue a fit.
    """
    found = {"normalisation": as_array(torch.cat([norm_state(norm) for _, norm in pairs], 1))}
    for k, (weight, bias) in enumerate(
        [*(folded(*pair) for pair in pairs), (out.weight, out.bias)]
    ):
        kernel = as_array(weight).transpose(2, 3, 1, 0)
        found[f"weight{k:02d}"] = kernel.reshape(9, *kernel.shape[2:]).astype(np.float16)
        found[f"bias{k:02d}"] = as_array(bias).astype(np.float16)
    for name, layer in dense.items():
        found[f"{name}_weight"] = as_array(layer.weight).T.astype(np.float16)
        found[f"{name}_bias"] = as_array(layer.bias).astype(np.float16)
    return found


def load_arrays(
    pairs: Sequence[tuple[Convolution, nn.BatchNorm2d]],
    out: nn.Conv2d,
    dense: Mapping[str, nn.Linear],
    arrays: Mapping[str, np.ndarray],
) -> None:
    """Start from weights in the core's layout; the inverse of `stored_arrays`.

    Parameters
    ----------
    pairs : sequence of (Convolution, BatchNorm2d)
        Changed in place, like `out` and `dense`.
    out : Conv2d
    dense : mapping of str to Linear
    arrays : mapping of str to ndarray
        Content of an archive.

    Raises
    ------
    InputError
        If they are the weights of another network.
    """
    try:
        states, last = arrays["normalisation"], len(pairs)
        with torch.no_grad():
            for k, (convolution, norm) in enumerate(pairs):
                state, states = states[:, : norm.num_features], states[:, norm.num_features :]
                restore(convolution, norm, arrays[f"weight{k:02d}"], state)
            out.weight.copy_(kernel_of(arrays[f"weight{last:02d}"]))
            out.bias.copy_(torch.from_numpy(arrays[f"bias{last:02d}"].astype(np.float32)))
            for name, layer in dense.items():
                layer.weight.copy_(torch.from_numpy(arrays[f"{name}_weight"].astype(np.float32).T))
                layer.bias.copy_(torch.from_numpy(arrays[f"{name}_bias"].astype(np.float32)))
    except (KeyError, RuntimeError) as error:
        raise InputError(f"these are the weights of another network: {error}") from error


def restore(
    convolution: Convolution, norm: nn.BatchNorm2d, weight: np.ndarray, state: np.ndarray
) -> None:
    """Take a convolution and its normalisation apart again; gradients must be off.

    Parameters
    ----------
    convolution : Convolution
    norm : BatchNorm2d
    weight : (9, inputs, outputs) ndarray
        What both do together.
    state : (4, outputs) ndarray
        Of the normalisation, see `norm_state`.
    """
    rows = torch.from_numpy(state.astype(np.float32))
    parts = (norm.weight, norm.bias, norm.running_mean, norm.running_var)
    for part, values in zip(parts, rows, strict=True):
        part.copy_(values)
    gain = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    convolution.weight.copy_(kernel_of(weight) / gain[:, None, None, None])


def restore_first(
    pairs: Sequence[tuple[Convolution, nn.BatchNorm2d]], arrays: Mapping[str, np.ndarray]
) -> None:
    """Start from the first blocks of a network that sees fewer channels, where shapes agree.

    Parameters
    ----------
    pairs : sequence of (Convolution, BatchNorm2d)
        Changed in place. Channels that only these see begin without effect.
    arrays : mapping of str to ndarray
        Content of an archive.
    """
    states, place = arrays["normalisation"], 0
    with torch.no_grad():
        for k, (convolution, norm) in enumerate(pairs):
            weight = arrays[f"weight{k:02d}"]
            _, inputs, outputs = weight.shape
            own = convolution.weight.shape
            if k == 0:  # blocks of pixels of a channel follow each other
                weight = np.pad(weight, ((0, 0), (0, own[1] - inputs), (0, 0)))
            if weight.shape[1:] != (own[1], own[0]):
                return
            restore(convolution, norm, weight, states[:, place : place + outputs])
            place += outputs
