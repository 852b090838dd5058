"""Fit the network of `isc_core.networks.layer_network`.

  python -m training.networks.layer_network --scenes DIR [--data ROOT --glossy DIR...
  [--exclude NAME...]] -o NETWORK.npz [--steps N]

`--scenes` is a run of `isc synth`. `--data` and `--glossy` are the MIT-Berkeley set and its glossy
versions from `isc synth glossy-mit`; `--exclude` names objects to leave out because the network
will be measured on them.

Equation: for y = log(image / diffuse), with the error e, the loss is .3 |e| + .7 Huber(e) + .5
|gradient of e|, each pixel weighted by its light, each photo by 1 / (.1 + mean y), so that weak
highlights count too; plus the Laplace likelihood of |e| for the scale b. What all pixels have in
common (the tenth percentile of each channel's y) is subtracted: a veil cannot be distinguished from
brighter light.

Citation: see `training.loop` and `training.networks.torch_layers`.

Limits: 40 % of the samples are of the MIT-Berkeley objects, if these are given.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from ..data.layered_objects import (
    LayeredObject,
    draw_sample,
    photographed_objects,
    rendered_objects,
)
from ..loop import Batch, Schedule, add_run_arguments, fit, run_options, split
from .torch_layers import ConvBlock, convolution_arrays, initialise, network_input

WIDTHS = (32, 48, 64, 96, 128)
SCHEDULE = Schedule(
    rate=8e-4,
    head_rate=8e-4,
    weight_decay=1e-3,
    warm_up=200,
    floor=1e-6,
    average_limit=0.999,
    average_delay=101,
)
_MARGIN = 2.0  # as in isc_core.networks.layer_network
_COMMON, _LARGEST_EXCESS = 0.1, 3.0
_PHOTOGRAPHED_SHARE = 0.4
_HUBER = 0.4


class LayerNetworkModule(nn.Module):  # type: ignore[misc]
    """The trainable layer network."""

    def __init__(self) -> None:
        super().__init__()
        steps = list(zip(WIDTHS[:-1], WIDTHS[1:], strict=True))
        self.down = nn.ModuleList(
            [ConvBlock(16, WIDTHS[0]), *(ConvBlock(fine, coarse) for fine, coarse in steps)]
        )
        self.up = nn.ModuleList([ConvBlock(fine + coarse, fine) for fine, coarse in steps])
        self.out = nn.Conv2d(WIDTHS[0], 16, 3, padding=1)
        initialise(self.modules())
        self.out.weight.data *= 0.1

    def forward(self, layer: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Predict y = log(image / diffuse) and the log of its Laplace scale b.

        Parameters
        ----------
        layer : (B, 4, H, W) tensor
            Output of `network_input`.

        Returns
        -------
        y : (B, 3, H, W) tensor
            Not negative.
        log_b : (B, 1, H, W) tensor
        """
        layer, kept = functional.pixel_unshuffle(layer, 2), []
        for level, block in enumerate(self.down):
            layer = block(layer if level == 0 else functional.avg_pool2d(layer, 2))
            kept.append(layer)
        for level in range(len(self.up) - 1, -1, -1):
            finer = functional.interpolate(layer, scale_factor=2, mode="nearest")
            layer = self.up[level](torch.cat([kept[level], finer], 1))
        raw = functional.pixel_shuffle(self.out(layer), 2)
        return functional.softplus(raw[:, :3] - _MARGIN), raw[:, 3:]

    def encoder_parameters(self) -> list[nn.Parameter]:
        """Return no parameters: nothing is fitted beforehand."""
        return []

    def loss(self, batch: Batch) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch.

        Parameters
        ----------
        batch : tuple of tensor
            Images and diffuse layers (B, 3, H, W), masks (B, 1, H, W).

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            Empty.
        """
        image, diffuse, mask = batch
        with torch.autocast("cpu", torch.bfloat16):
            found, log_scale = self(network_input(image, mask))
        return _loss(found.float(), log_scale.float(), image, diffuse, mask), {}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""
        blocks = [*self.down, *reversed(self.up)]
        inner = [layer for block in blocks for layer in (block.c1, block.c2)]
        return convolution_arrays([*inner, self.out])


def log_excess(image: torch.Tensor, diffuse: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Compute y without what all pixels of an object have in common.

    Parameters
    ----------
    image, diffuse : (B, 3, H, W) tensor
        Linear light.
    mask : (B, 1, H, W) tensor
        1 on the object, 0 elsewhere.

    Returns
    -------
    (B, 3, H, W) tensor
        y >= 0.
    """
    excess = torch.log(image.clamp(min=1e-5)) - torch.log(diffuse.clamp(min=1e-5))
    excess = excess.clamp(0, _LARGEST_EXCESS)
    outside = torch.full_like(excess, 3 * _LARGEST_EXCESS)
    ordered = torch.where(mask.expand_as(excess) > 0, excess, outside).flatten(2).sort(2).values
    place = (_COMMON * mask.sum((2, 3))).long().clamp(min=1)[:, :, None].expand(-1, 3, 1)
    common = ordered.gather(2, place)[..., None].clamp(max=_LARGEST_EXCESS)
    return (excess - common).clamp(min=0)


def _loss(
    found: torch.Tensor,
    log_scale: torch.Tensor,
    image: torch.Tensor,
    diffuse: torch.Tensor,
    mask: torch.Tensor,
) -> torch.Tensor:
    target = log_excess(image, diffuse, mask)
    light = image.mean(1, keepdim=True)
    mean = (light * mask).sum((2, 3), keepdim=True) / mask.sum((2, 3), keepdim=True).clamp(min=1)
    weight = mask * (light / mean.clamp(min=1e-6)).clamp(0.1, 1)
    weight = weight / weight.sum((2, 3), keepdim=True).clamp(min=100)
    error, log_scale = found - target, log_scale.clamp(-4, 2)
    size = error.abs()
    huber = torch.where(size < _HUBER, size * size / _HUBER, 2 * size - _HUBER)
    size, huber = size.mean(1, keepdim=True), huber.mean(1, keepdim=True)
    level = (target.mean(1, keepdim=True) * weight).sum((1, 2, 3))
    data = ((0.3 * size + 0.7 * huber) * weight).sum((1, 2, 3)) + 0.5 * _gradient(error, mask)
    likelihood = ((size.detach() / log_scale.exp() + log_scale) * weight).sum((1, 2, 3))
    return (data * 0.2 / (0.1 + level) + 0.05 * likelihood).mean()


def _gradient(error: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Mean absolute difference (B,) of the error between neighbouring pixels."""
    count = mask.sum((1, 2, 3)).clamp(min=100)
    across = (error[..., 1:] - error[..., :-1]).abs() * mask[..., 1:] * mask[..., :-1]
    down = (error[..., 1:, :] - error[..., :-1, :]).abs() * mask[..., 1:, :] * mask[..., :-1, :]
    return (across.mean(1).sum((1, 2)) + down.mean(1).sum((1, 2))) / count


@dataclass(frozen=True)
class LayerBatches:
    """Draws batches.

    Attributes
    ----------
    objects : sequence of LayeredObject
        Not empty.
    size : int
        Photos per batch.
    """

    objects: Sequence[LayeredObject]
    size: int

    @cached_property
    def _groups(self) -> list[list[int]]:
        """Indices of the rendered objects and of the photographed ones, those that exist."""
        rendered = [k for k, one in enumerate(self.objects) if not one.name]
        photographed = [k for k, one in enumerate(self.objects) if one.name]
        return [group for group in (rendered, photographed) if group]

    def __call__(self, rng: np.random.Generator) -> Batch:
        """Draw images and diffuse layers (B, 3, CROP, CROP) and masks (B, 1, CROP, CROP)."""
        shares = [rng.random() for _ in range(self.size)]
        chosen = [self._groups[-1 if one < _PHOTOGRAPHED_SHARE else 0] for one in shares]
        photos = [draw_sample(self.objects, int(rng.choice(group)), rng) for group in chosen]
        return tuple(torch.stack(layers) for layers in zip(*photos, strict=True))


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--scenes", type=Path, required=True, metavar="DIR", help="a run of isc synth")
    add("--data", type=Path, metavar="ROOT", help="the MIT-Berkeley set")
    add("--glossy", type=Path, nargs="+", default=[], metavar="DIR", help="glossy-mit runs")
    add("--exclude", nargs="+", default=[], metavar="NAME", help="objects to leave out")
    add_run_arguments(parser, steps=12000, batch=10)
    arguments = parser.parse_args()
    objects = list(rendered_objects(arguments.scenes))
    if arguments.data and arguments.glossy:
        photographed = photographed_objects(arguments.data, arguments.glossy)
        objects += [one for one in photographed if one.name not in arguments.exclude]
    if not objects:
        parser.error("no samples; make some with isc synth")
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    training, held_out = split(objects, lambda one: one.family, options)
    validation = LayerBatches(held_out, options.batch) if held_out else None
    fit(LayerNetworkModule(), LayerBatches(training, options.batch), SCHEDULE, options, validation)


if __name__ == "__main__":
    main()
