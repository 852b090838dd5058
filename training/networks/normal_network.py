"""Fit the network of `isc_core.networks.normal_network`.

  python -m training.networks.normal_network OBJECTS... [--measured DIR] [--exclude NAME...]
  [--start STATE.pt] [--steps N] -o NORMALS.npz

OBJECTS and `--measured` are folders of `training.data.traced_objects`. Every sample relights one of
the objects (`training.data.relighting`), most of them after a linear map of space that makes the
object flatter or deeper, narrower, and skewed. One sample in four is of a measured object, if there
are any. `--exclude` names shapes to leave out because the network will be measured on them. The
encoder starts from the shipped light network.

Equation: the loss is the squared error of the cells' mean unit normals plus, for the deviation s,
the negative log likelihood of their in-plane components, in which the means are held constant.

Citation: see `training.loop` and `training.networks.torch_layers`.

Limits: one deviation per cell for both in-plane components.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.networks.light_network import LightNetwork
from isc_core.networks.normal_network import CELL, LONG_SIDE, MAX_LOG_DEVIATION, MIN_LOG_DEVIATION

from ..data.random_draws import log_uniform
from ..data.relighting import LightCount, RelightableObject, draw_photo, relightable_objects
from ..data.relit_samples import OBJECT_SIDE, Transform, sample_of
from ..data.traced_objects import SIZE
from ..loop import Batch, Schedule, add_run_arguments, fit, run_options, split
from .torch_layers import (
    ConvBlock,
    convolution_arrays,
    encoder_from,
    initialise,
    network_input,
)

SCHEDULE = Schedule(rate=4e-4, head_rate=1e-3)
_COUNT_SHARES = (0.35, 0.45, 0.2)  # of NONE, ONE, SEVERAL
_MAPPED_SHARE, _MEASURED_SHARE = 0.7, 0.25  # of the samples
# of the maps: scale across, scale in depth, deviation of the skew
_ACROSS, _DEPTH, _SKEW = (0.6, 1.0), (0.35, 1.5), 0.2
_FRONTAL = math.cos(math.radians(75))  # of lights that count as in front of the object
_LEAST_FRONTAL = 5  # lights in front of a mapped object
_LIKELIHOOD_WEIGHT = 0.1


class NormalNetworkModule(nn.Module):  # type: ignore[misc]
    """The trainable normal network."""

    def __init__(self) -> None:
        super().__init__()
        start = LightNetwork.shipped()
        self.down = encoder_from(start.weights, start.biases)
        widths = [one.out_channels for one in list(self.down)[1::2]]
        steps = zip(widths[1:-1], widths[2:], strict=True)
        self.up = nn.ModuleList([ConvBlock(fine + coarse, fine) for fine, coarse in steps])
        self.out = nn.Conv2d(widths[1], 4, 3, padding=1)
        initialise([*self.up.modules(), self.out])
        self.out.weight.data *= 0.1
        self.to(memory_format=torch.channels_last)

    def forward(self, layer: torch.Tensor) -> torch.Tensor:
        """Predict the cells' mean normals and their log deviation.

        Parameters
        ----------
        layer : (B, 4, side, side) tensor
            Inputs.

        Returns
        -------
        (B, 4, side / CELL, side / CELL) tensor
            Channels 0-2: mean normals; 3: log deviation.
        """
        layer, kept = layer.contiguous(memory_format=torch.channels_last), []
        layer = functional.pixel_unshuffle(layer, 2)
        with torch.autocast("cpu", torch.bfloat16, enabled=self.training):
            for level in range(len(self.down) // 2):
                layer = functional.avg_pool2d(layer, 2) if level else layer
                for one in self.down[2 * level : 2 * level + 2]:
                    layer = functional.relu(one(layer))
                kept.append(layer)
            for level in range(len(self.up) - 1, -1, -1):
                finer = functional.interpolate(layer, scale_factor=2, mode="nearest")
                layer = self.up[level](torch.cat([kept[level + 1], finer], 1))
            return self.out(layer).float()

    def encoder_parameters(self) -> list[nn.Parameter]:
        """Return the parameters that start from a fitted encoder."""
        return list(self.down.parameters())

    def loss(self, batch: Batch) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch and its terms.

        Parameters
        ----------
        batch : tuple of tensor
            As `NormalBatches` returns it.

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            "normals" and "likelihood", each ().
        """
        inputs, normals, cover = batch
        found = self(inputs)
        error = (found[:, :3] - normals) ** 2
        share = cover / cover.sum((1, 2, 3), keepdim=True).clamp(min=1) / len(cover)
        log_deviation = found[:, 3:].clamp(MIN_LOG_DEVIATION, MAX_LOG_DEVIATION)
        squared = (error.sum(1, keepdim=True) * share).sum()
        in_plane = 0.5 * error[:, :2].sum(1, keepdim=True).detach()
        likelihood = (in_plane * torch.exp(-2 * log_deviation) + 2 * log_deviation) * share
        likelihood = likelihood.sum()
        terms = {"normals": squared, "likelihood": likelihood}
        return squared + _LIKELIHOOD_WEIGHT * likelihood, terms

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""
        up = [one for block in reversed(self.up) for one in (block.c1, block.c2)]
        return convolution_arrays([*self.down, *up, self.out])


@dataclass(frozen=True)
class NormalBatches:
    """Draws batches.

    Attributes
    ----------
    objects : sequence of RelightableObject
        Not empty.
    measured : sequence of RelightableObject
        Measured objects; may be empty.
    size : int
        Photos per batch; every second one is a mirror image.
    """

    objects: Sequence[RelightableObject]
    measured: Sequence[RelightableObject]
    size: int

    def __call__(self, rng: np.random.Generator) -> Batch:
        """Draw a batch.

        Parameters
        ----------
        rng : np.random.Generator
            Draws objects, maps, light and camera.

        Returns
        -------
        inputs : (B, 4, side, side) tensor
            Inputs of the network.
        normals : (B, 3, side / CELL, side / CELL) tensor
            Mean normals of cells.
        coverage : (B, 1, side / CELL, side / CELL) tensor
            Share of each cell that the object covers.
        """
        drawn: list[Batch] = []
        while len(drawn) < self.size:
            measured = self.measured and rng.random() < _MEASURED_SHARE
            chosen = self.measured if measured else self.objects
            drawn += _samples(chosen[int(rng.integers(len(chosen)))], rng)
        return tuple(torch.stack(parts) for parts in zip(*drawn[: self.size], strict=True))


def _samples(relit: RelightableObject, rng: np.random.Generator) -> list[Batch]:
    """Two photos of an object in one light, one of them mirrored."""
    across = np.ones(2)
    if rng.random() < _MAPPED_SHARE:
        relit, across = _randomly_mapped(relit, rng)
    count = LightCount(int(rng.choice(len(LightCount), p=_COUNT_SHARES)))
    lit = draw_photo(relit, rng, count)
    samples = []
    for mirror in (False, True):
        transform = _random_transform(across, mirror, rng)
        sample = sample_of(lit, relit, transform, CELL, rng)
        inputs = network_input(sample.image[None], sample.mask[None, None])[0]
        samples.append((inputs, sample.normals, sample.coverage))
    return samples


def _randomly_mapped(
    relit: RelightableObject, rng: np.random.Generator
) -> tuple[RelightableObject, np.ndarray]:
    """The object after a random linear map, and the scale (2,) of its image in x and y."""
    mapped, across = relit, np.ones(2)
    for _ in range(9):
        across = np.ones(2)
        across[int(rng.integers(2))] = log_uniform(rng, *_ACROSS)
        depth, skew = log_uniform(rng, *_DEPTH), rng.normal(0, _SKEW, 2)
        mapped = relit.mapped(np.array([[across[0], 0, 0], [0, across[1], 0], [*skew, depth]]))
        if (mapped.toward[:, 2] > _FRONTAL).sum() >= _LEAST_FRONTAL:
            break
    return mapped, across


def _random_transform(across: np.ndarray, mirror: bool, rng: np.random.Generator) -> Transform:
    scale = 1.0 if rng.random() < 0.6 else log_uniform(rng, 0.7, 1.02)
    factor = LONG_SIDE / OBJECT_SIDE / across.max() * scale
    rows, columns = (max(8, round(SIZE * factor * part)) for part in across[::-1])
    turns = int(rng.integers(1, 4)) if rng.random() < 0.3 else 0
    return Transform((rows, columns), turns, mirror)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("objects", type=Path, nargs="+", help="folders of training.data.traced_objects")
    add("--measured", type=Path, nargs="+", default=[], metavar="DIR", help="measured objects")
    add("--exclude", nargs="+", default=[], metavar="NAME", help="shapes to leave out")
    add_run_arguments(parser, steps=7000, batch=32)
    arguments = parser.parse_args()
    objects = list(relightable_objects(arguments.objects, arguments.exclude))
    measured = list(relightable_objects(arguments.measured, arguments.exclude))
    if not objects:
        parser.error("no samples; make some with training.data.traced_objects")
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    training, held_out = split(objects, lambda one: one.shape, options)
    draw = NormalBatches(training, measured, options.batch)
    validation = NormalBatches(held_out, [], options.batch) if held_out else None
    fit(NormalNetworkModule(), draw, SCHEDULE, options, validation)


if __name__ == "__main__":
    main()
