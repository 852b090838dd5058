"""Fit the network of `isc_core.networks.light_network`.

  python -m training.networks.light_network OBJECTS... [--exclude NAME...] [--steps N] -o LIGHT.npz

OBJECTS are folders of `training.data.traced_objects`. Every sample relights one of the objects
(`training.data.relighting`): ambient light alone, one directional light, or two to four.
`--exclude` names shape families to leave out because the network will be measured on them. The
encoder starts from the shipped layer network.

Equation: the loss is the sum of four terms: the cross entropy of the number of lights; that of
their directions, with the lights' shares blurred over some degrees; the squared error of the mean
normals of cells of 16 x 16 pixels, so that light and shape are separated; and the negative log
likelihood of the light's parameters (`isc_core.sirfs.priors.predicted_light`).

Citation: see `training.loop`; the network: `isc_core.networks.light_network`.

Limits: distant lights only.
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

from isc_core.networks.layer_network import LayerNetwork
from isc_core.networks.light_network import CELL, LONG_SIDE, MAX_LOG_DEVIATION, MIN_LOG_DEVIATION
from isc_core.scene.light_estimate import PLACES
from isc_core.shading.spherical_harmonics import real_sh
from isc_core.sirfs.priors.predicted_light import FRONT_NORMALS, LIGHT_TERMS

from ..data.random_draws import log_uniform
from ..data.relighting import LightCount, RelightableObject, draw_photo, relightable_objects
from ..data.relit_samples import OBJECT_SIDE, Transform, sample_of, transformed_vectors
from ..data.traced_objects import SIZE
from ..loop import Batch, Schedule, add_run_arguments, fit, run_options, split
from .torch_layers import convolution_arrays, encoder_from, network_input

SCHEDULE = Schedule(rate=4e-4, head_rate=1e-3)
_COUNT_SHARES = (0.25, 0.4, 0.35)  # of NONE, ONE, SEVERAL
_BLUR = math.radians(8)  # of a light's direction
_NORMALS_WEIGHT = 1.0  # in the loss
_LOCAL, _GLOBAL = 192, 256  # features
_EVERY = 8  # pixels per sample of the shading
_DARKEST = 0.05  # of the mean shading: darker pixels are in shadow
_RIDGE = 0.05  # weight of uniform light in the fit of the light's parameters


class LightNetworkModule(nn.Module):  # type: ignore[misc]
    """The trainable light network."""

    def __init__(self) -> None:
        super().__init__()
        self.convolutions = encoder_from(*LayerNetwork.shipped().encoder)
        count = sum(one.out_channels for one in list(self.convolutions)[1::2])
        self.scaled = nn.BatchNorm1d(count, momentum=0.02)
        self.local = nn.Linear(count + 5, _LOCAL)
        self.normal = nn.Linear(_LOCAL, 3)
        self.whole = nn.Linear(3 * _LOCAL, _GLOBAL)
        self.dropped = nn.Dropout(0.1)
        self.lamps = nn.Linear(_GLOBAL, 3)
        self.places = nn.Linear(_GLOBAL, len(PLACES))
        self.light = nn.Linear(_GLOBAL, 2 * len(LIGHT_TERMS))

    def forward(self, layer: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Predict the light and coarse normals.

        Parameters
        ----------
        layer : (B, 4, side, side) tensor
            Inputs.

        Returns
        -------
        count : (B, 3) tensor
            Log odds of the number of lights.
        places : (B, P) tensor
            Log odds of their directions.
        light : (B, 16) tensor
            Parameters of the light, and the log of their deviations.
        normals : (B, 3, side / CELL, side / CELL) tensor
            Mean normals of the cells.
        """
        cover = functional.avg_pool2d(layer[:, 3:], CELL)
        cells = self._cells(functional.pixel_unshuffle(layer, 2))
        batch, channels, rows, columns = cells.shape
        flat = cells.permute(0, 2, 3, 1).reshape(-1, channels)
        total = cover.sum((1, 2, 3)).reshape(-1, 1, 1).clamp(min=1e-6)
        weight = cover.reshape(batch, -1, 1) / total
        where = _cell_positions(rows, columns, weight)
        inside = torch.cat([self.scaled(flat).reshape(batch, -1, channels), where], 2)
        inside = functional.relu(self.local(inside))
        normals = self.normal(inside).permute(0, 2, 1).reshape(batch, 3, rows, columns)
        mean = (weight * inside).sum(1)
        spread = ((weight * inside**2).sum(1) - mean**2).clamp(min=1e-6).sqrt()
        largest = (inside * (weight > 0.2 * weight.amax(1, keepdim=True))).amax(1)
        features = self.dropped(torch.cat([mean, spread, largest], 1))
        whole = functional.relu(self.whole(features))
        return self.lamps(whole), self.places(whole), self.light(whole), normals

    def _cells(self, layer: torch.Tensor) -> torch.Tensor:
        """The encoder's features of all levels, averaged over cells."""
        features = []
        for level in range(len(self.convolutions) // 2):
            if level:
                layer = functional.avg_pool2d(layer, 2)
            with torch.autocast("cpu", torch.bfloat16, enabled=self.training):
                for one in self.convolutions[2 * level : 2 * level + 2]:
                    layer = functional.relu(one(layer))
            step, values = 2 ** (level + 1), layer.float()
            pooled = functional.avg_pool2d(values, CELL // step) if step < CELL else values
            features.append(functional.interpolate(pooled, scale_factor=max(1, step // CELL)))
        return torch.sqrt(torch.cat(features, 1).clamp(0, 1e4) + 1e-6)

    def encoder_parameters(self) -> list[nn.Parameter]:
        """Return the parameters that start from a fitted encoder."""
        return list(self.convolutions.parameters())

    def loss(self, batch: Batch) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch and its terms.

        Parameters
        ----------
        batch : tuple of tensor
            As `LightBatches` returns it.

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            "count", "direction", "normals" and "light", each ().
        """
        inputs, count, places, normals, light = batch
        count_odds, place_odds, predicted, shape = self(inputs)
        counts = functional.cross_entropy(count_odds, count)
        lit = count != LightCount.NONE
        directions = -(places * functional.log_softmax(place_odds, 1)).sum(1)[lit].mean()
        cover = functional.avg_pool2d(inputs[:, 3:], CELL)
        shapes = (((shape - normals) ** 2).sum(1, keepdim=True) * cover).sum() / cover.sum()
        parameters = light.shape[1]
        log_deviation = predicted[:, parameters:].clamp(MIN_LOG_DEVIATION, MAX_LOG_DEVIATION)
        error = (light - predicted[:, :parameters]) * torch.exp(-log_deviation)
        lights = (0.5 * error**2 + log_deviation).mean()
        terms = {"count": counts, "direction": directions, "normals": shapes, "light": lights}
        return counts + directions + _NORMALS_WEIGHT * shapes + lights, terms

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""
        norm, found = self.scaled, {}
        scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
        found["middle"], found["scale"] = (norm.running_mean - norm.bias / scale), scale
        for name in ("local", "whole", "lamps", "places", "light"):
            one = getattr(self, name)
            found[f"{name}_weight"], found[f"{name}_bias"] = one.weight.T, one.bias
        return convolution_arrays(self.convolutions) | {
            name: values.detach().numpy().astype(np.float16) for name, values in found.items()
        }


def _cell_positions(rows: int, columns: int, weight: torch.Tensor) -> torch.Tensor:
    """x, y, their squares and product (B, cells, 5), centred, over the object's extent."""
    row, column = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
    place = torch.stack([column.reshape(-1), -row.reshape(-1)], 1).float()[None]
    off = place - (weight * place).sum(1, keepdim=True)
    x, y = (off / (weight * off**2).sum((1, 2), keepdim=True).clamp(min=1e-6).sqrt()).unbind(2)
    return torch.stack([x, y, x * x, y * y, x * y], 2)


@dataclass(frozen=True)
class LightBatches:
    """Draws batches.

    Attributes
    ----------
    objects : sequence of RelightableObject
        Not empty.
    size : int
        Photos per batch.
    """

    objects: Sequence[RelightableObject]
    size: int

    def __call__(self, rng: np.random.Generator) -> Batch:
        """Draw a batch.

        Parameters
        ----------
        rng : np.random.Generator
            Draws objects, light and camera.

        Returns
        -------
        inputs : (B, 4, side, side) tensor
            Inputs of the network.
        count : (B,) tensor
            `LightCount`.
        places : (B, P) tensor
            Probabilities of the lights' directions.
        normals : (B, 3, side / CELL, side / CELL) tensor
            Mean normals of cells.
        light : (B, 8) tensor
            Parameters of the light.
        """
        count = len(self.objects)
        drawn = [_sample(self.objects[int(rng.integers(count))], rng) for _ in range(self.size)]
        return tuple(torch.stack(parts) for parts in zip(*drawn, strict=True))


def _sample(relit: RelightableObject, rng: np.random.Generator) -> Batch:
    """One photo and its ground truth, as in a batch."""
    count = LightCount(int(rng.choice(len(LightCount), p=_COUNT_SHARES)))
    lit = draw_photo(relit, rng, count)
    factor = LONG_SIDE / OBJECT_SIDE * (1.0 if rng.random() < 0.5 else log_uniform(rng, 0.6, 1.02))
    turns = int(rng.integers(1, 4)) if rng.random() < 0.15 else 0
    side = round(SIZE * factor)
    transform = Transform((side, side), turns, bool(rng.random() < 0.5))
    sample = sample_of(lit, relit, transform, CELL, rng)
    toward = torch.from_numpy(lit.toward.astype(np.float32))
    normals = torch.from_numpy(relit.normals[::_EVERY].astype(np.float32))
    turned = transformed_vectors(normals, transform).numpy()
    return (
        network_input(sample.image[None], sample.mask[None, None])[0],
        torch.tensor(int(lit.count)),
        _direction_probabilities(transformed_vectors(toward, transform), lit.shares),
        sample.normals,
        torch.from_numpy(_light_parameters(turned, lit.shading[::_EVERY])),
    )


def _light_parameters(normals: np.ndarray, shading: np.ndarray) -> np.ndarray:
    """Parameters (8,) float32 of the light that fits the log shading (N,) at normals (N, 3)."""
    level = float(shading.mean())
    values = np.log(np.maximum(shading / max(level, 1e-9), _DARKEST))
    basis, evenly = real_sh(normals.astype(float)), real_sh(FRONT_NORMALS)
    matrix = basis.T @ basis / len(basis) + _RIDGE * evenly.T @ evenly / len(evenly)
    start = _RIDGE * evenly.T @ np.full(len(evenly), values.mean()) / len(evenly)
    light = np.linalg.solve(matrix, basis.T @ values / len(basis) + start)
    return np.asarray(LIGHT_TERMS @ light, np.float32)


def _direction_probabilities(toward: torch.Tensor, shares: np.ndarray) -> torch.Tensor:
    """Probabilities (P,) of PLACES for lights toward (K, 3); uniform without lights."""
    places = torch.from_numpy(PLACES.astype(np.float32))
    if not len(toward):
        return torch.full((len(places),), 1 / len(places))
    near = torch.softmax(places @ toward.T / _BLUR**2, 0)
    return near @ torch.from_numpy(shares.astype(np.float32))


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("objects", type=Path, nargs="+", help="folders of training.data.traced_objects")
    add("--exclude", nargs="+", default=[], metavar="NAME", help="shapes to leave out")
    add_run_arguments(parser, steps=20000, batch=32)
    arguments = parser.parse_args()
    objects = list(relightable_objects(arguments.objects, arguments.exclude))
    if not objects:
        parser.error("no samples; make some with training.data.traced_objects")
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    training, held_out = split(objects, lambda one: one.shape, options)
    validation = LightBatches(held_out, options.batch) if held_out else None
    fit(LightNetworkModule(), LightBatches(training, options.batch), SCHEDULE, options, validation)


if __name__ == "__main__":
    main()
