"""Fit the network of `isc_core.networks.scene_classifier`.

  python -m training.networks.scene_classifier SCENES... --synth DIR [--data ROOT --glossy DIR...]
  [--exclude NAME...] -o CLASSIFIER.npz

SCENES are folders of `training.data.rendered_scenes`. `--synth` is a run of `isc synth`, whose
training scenes count as ordinary. `--data` and `--glossy` are the MIT-Berkeley set and its glossy
versions from `isc synth glossy-mit`, ordinary too. `--exclude` names shape families, objects of the
set and environments to leave out because the network will be measured on them. The encoder starts
from a layer network (`--encoder`, by default the shipped one); `--exclude` does not undo what that
has seen.

Equation: the loss is -log of the probability of the allowed labels, with 2 % label smoothing.

Citation: see `training.loop`; the network: `isc_core.networks.scene_classifier`.

Limits: the sampling shares of the groups are fixed below; groups without samples are skipped.
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

from isc_core.networks.layer_network import LayerNetwork
from isc_core.networks.scene_classifier import KINDS

from ..data.labelled_photos import (
    LabelledObject,
    draw_photo,
    photographed_objects,
    rendered_objects,
    synthetic_objects,
)
from ..loop import Batch, Schedule, add_run_arguments, fit, run_options, split
from .torch_layers import convolution_arrays, encoder_from, network_input

SCHEDULE = Schedule(rate=3e-4, head_rate=1.5e-3, warm_up=50)
_SHARES = {
    "synth": 0.13, "photo": 0.15, "light": 0.04, "environment": 0.15, "diffuse": 0.05,
    "mirror": 0.16, "glass": 0.13, "lights": 0.07, "rig": 0.28,
}  # fmt: skip
_SMOOTHING = 0.02


class SceneClassifierModule(nn.Module):  # type: ignore[misc]
    """The trainable scene classifier.

    Parameters
    ----------
    start : LayerNetwork
        Its encoder is where this one starts.
    """

    def __init__(self, start: LayerNetwork) -> None:
        super().__init__()
        self.convolutions = encoder_from(*start.encoder)
        count = 3 * sum(one.out_channels for one in list(self.convolutions)[1::2])
        self.scaled = nn.BatchNorm1d(count, momentum=0.05)
        self.dropped = nn.Dropout(0.3)
        self.head = nn.Linear(count, len(KINDS))
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)

    def forward(self, layer: torch.Tensor) -> torch.Tensor:
        """Return the log odds of the scene kinds.

        Parameters
        ----------
        layer : (B, 4, side, side) tensor
            Inputs.

        Returns
        -------
        (B, 4) tensor
            In the order of `KINDS`.
        """
        cover, features = functional.avg_pool2d(layer[:, 3:], 2), []
        layer = functional.pixel_unshuffle(layer, 2)
        for level in range(len(self.convolutions) // 2):
            if level:
                layer, cover = functional.avg_pool2d(layer, 2), functional.avg_pool2d(cover, 2)
            with torch.autocast("cpu", torch.bfloat16, enabled=self.training):
                for one in self.convolutions[2 * level : 2 * level + 2]:
                    layer = functional.relu(one(layer))
            weight = cover / cover.sum((2, 3), keepdim=True).clamp(min=1e-6)
            values = layer.float().clamp(max=1e4)
            first, second, fourth = ((values**power * weight).sum((2, 3)) for power in (1, 2, 4))
            deviation = (second - first**2).clamp(min=1e-6).sqrt()
            features += [first, deviation, (fourth + 1e-12) ** 0.25]
        return self.head(self.dropped(self.scaled(torch.sqrt(torch.cat(features, 1) + 1e-6))))

    def encoder_parameters(self) -> list[nn.Parameter]:
        """Return the parameters that start from a fitted encoder."""
        return list(self.convolutions.parameters())

    def loss(self, batch: Batch) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch.

        Parameters
        ----------
        batch : tuple of tensor
            Inputs (B, 4, side, side) and allowed labels (B, 4), 1 or 0.

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            Empty.
        """
        inputs, allowed = batch
        log_share = functional.log_softmax(self(inputs), 1)
        right = torch.logsumexp(log_share + torch.log(allowed + 1e-9), 1)
        return -((1 - _SMOOTHING) * right + _SMOOTHING * log_share.mean(1)).mean(), {}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""
        norm, head = self.scaled, self.head
        return convolution_arrays(self.convolutions) | {
            "middle": norm.running_mean.numpy(),
            "scale": torch.sqrt(norm.running_var + norm.eps).numpy(),
            "head": (head.weight * norm.weight).detach().numpy().T,
            "odds": (head.bias + head.weight @ norm.bias).detach().numpy(),
        }


@dataclass(frozen=True)
class SceneBatches:
    """Draws batches.

    Attributes
    ----------
    objects : sequence of LabelledObject
        Not empty.
    size : int
        Photos per batch.
    """

    objects: Sequence[LabelledObject]
    size: int

    @cached_property
    def _groups(self) -> dict[str, list[LabelledObject]]:
        groups = {name: [one for one in self.objects if one.group == name] for name in _SHARES}
        return {name: members for name, members in groups.items() if members}

    def __call__(self, rng: np.random.Generator) -> Batch:
        """Draw inputs (B, 4, side, side) and allowed labels (B, 4)."""
        names, shares = list(self._groups), np.array([_SHARES[name] for name in self._groups])
        drawn = rng.choice(names, self.size, p=shares / shares.sum())
        chosen = [self._groups[name] for name in drawn]
        photos = [draw_photo(one[int(rng.integers(len(one)))], rng) for one in chosen]
        images, masks, allowed = zip(*photos, strict=True)
        inputs = network_input(torch.stack(images), torch.stack(masks)[:, None])
        return inputs, torch.tensor(allowed, dtype=torch.float32)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("scenes", type=Path, nargs="+", help="folders of training.data.rendered_scenes")
    add("--synth", type=Path, required=True, metavar="DIR", help="a run of isc synth")
    add("--data", type=Path, metavar="ROOT", help="the MIT-Berkeley set")
    add("--glossy", type=Path, nargs="+", default=[], metavar="DIR", help="glossy-mit runs")
    add("--encoder", type=Path, metavar="NPZ", help="layer network to start from")
    add("--exclude", nargs="+", default=[], metavar="NAME", help="shapes or environments")
    add_run_arguments(parser, steps=5000, batch=12)
    arguments = parser.parse_args()
    objects = [
        *synthetic_objects(arguments.synth),
        *(one for folder in arguments.scenes for one in rendered_objects(folder)),
    ]
    if arguments.data:
        objects += photographed_objects(arguments.data, arguments.glossy)
    excluded = set(arguments.exclude)
    objects = [one for one in objects if not {one.family, one.environment} & excluded]
    if not objects:
        parser.error("no samples; make some with training.data.rendered_scenes and isc synth")
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    path = arguments.encoder
    network = SceneClassifierModule(
        LayerNetwork.shipped() if path is None else LayerNetwork.read(path)
    )
    training, held_out = split(objects, lambda one: one.family, options)
    validation = SceneBatches(held_out, options.batch) if held_out else None
    fit(network, SceneBatches(training, options.batch), SCHEDULE, options, validation)


if __name__ == "__main__":
    main()
