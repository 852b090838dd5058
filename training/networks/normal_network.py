"""Fits the network of `isc_core.networks.normal_network`.

  python -m training.networks.normal_network OBJECTS... [--measured DIR] [--leave NAME...] [--start
  STATE.pt] [--steps N] -o SHAPE.npz

OBJECTS, `--measured`: of `training.data.traced_objects`; every picture lights one of them anew
(`training.data.relighting`), most after a linear map of space that makes it flatter or deeper,
narrower, and leaning; one picture in four is of a measured object, where there are any. `--leave`:
shapes that the network must not see, because it will be measured on them. It begins with the
encoder of the lamp network that ships. Needs PyTorch (`pip install 'isc3d[training]'`), which
nothing else of ISC does.

Loss: the squared error of the unit normals' means; and, for the deviation s, minus the log
likelihood of their in-plane parts, in which the means are held. Adam with decoupled weight decay
(I. Loshchilov and F. Hutter 2019, arXiv:1711.05101), a cosine of steps, averaged weights.
"""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.networks.light_network import shipped_lamp_network
from isc_core.networks.normal_network import CELL, LONG_SIDE, SURE, UNSURE
from training.data.random_draws import log_uniform
from training.data.relighting import NONE, ONE, SEVERAL, Lit, Relit, draw_photo
from training.data.traced_objects import SIZE, objects_in
from training.loop import optimised
from training.networks.scene_classifier import sensed
from training.networks.layer_network import Block, arrays_of, encoder_of, inputs

_SIDE = 128  # of the pictures that it learns from
_OBJECT = 0.9 * SIZE  # of an unlit object, its longer side
_CHANCES = (0.35, 0.45, 0.2)  # of NONE, ONE, SEVERAL
_MAPPED, _MEASURED = 0.7, 0.25  # shares of the pictures
_NARROW, _DEEP, _LEANING = (
    (0.6, 1.0),
    (0.35, 1.5),
    0.2,
)  # of the maps: across, in depth, how much depth rises across
_AT_THE_SIDE = math.cos(math.radians(75))  # some lamps have to stand before it
_BATCH = 32
_LIKELIHOOD = 0.1  # weight in the loss


class Draws(torch.utils.data.IterableDataset[tuple[torch.Tensor, ...]]):  # type: ignore[misc]
    """Batches without end: input (B, 4, side, side), normals (B, 3, side / CELL, side / CELL), and
    how much of a cell the object covers (B, 1, side / CELL, side / CELL).
    """

    def __init__(self, objects: list[Relit], measured: list[Relit], seed: int) -> None:
        self._objects, self._measured, self._seed = objects, measured, seed

    def __iter__(self) -> Iterator[tuple[torch.Tensor, ...]]:
        rng = np.random.default_rng([self._seed, 5])
        torch.manual_seed(self._seed)
        torch.set_num_threads(1)
        while True:
            drawn = [one for _ in range(_BATCH // 2) for one in draw(self._any(rng), rng)]
            yield tuple(torch.stack(parts) for parts in zip(*drawn, strict=True))

    def _any(self, rng: np.random.Generator) -> Relit:
        chosen = self._measured if self._measured and rng.random() < _MEASURED else self._objects
        return chosen[int(rng.integers(len(chosen)))]


def draw(relit: Relit, rng: np.random.Generator) -> list[tuple[torch.Tensor, ...]]:
    """Two pictures of an object in one light, one of them mirrored, and what is true of each, see
    `Draws`.
    """
    narrow = np.ones(2)
    if rng.random() < _MAPPED:
        relit, narrow = _mapped(relit, rng)
    lit = draw_photo(relit, rng, int(rng.choice([NONE, ONE, SEVERAL], p=_CHANCES)))
    return [_taken(lit, relit, narrow, mirror, rng) for mirror in (False, True)]


def _mapped(relit: Relit, rng: np.random.Generator) -> tuple[Relit, np.ndarray]:
    """The object after a map that is drawn, and how much narrower and lower (2,) its picture is
    then.
    """
    found, narrow = relit, np.ones(2)
    for _ in range(9):
        narrow = np.ones(2)
        narrow[int(rng.integers(2))] = log_uniform(rng, *_NARROW)
        deep, leaning = log_uniform(rng, *_DEEP), rng.normal(0, _LEANING, 2)
        found = relit.mapped(np.array([[narrow[0], 0, 0], [0, narrow[1], 0], [*leaning, deep]]))
        if (found.toward[:, 2] > _AT_THE_SIDE).sum() > 4:
            break
    return found, narrow


def _taken(
    lit: Lit, relit: Relit, narrow: np.ndarray, mirror: bool, rng: np.random.Generator
) -> tuple[torch.Tensor, ...]:
    """The picture that a camera takes, at some size, place and turn."""
    normals = np.zeros((*relit.mask.shape, 3), np.float32)
    normals[relit.mask] = relit.normals
    layers = torch.from_numpy(
        np.concatenate([lit.photo, normals, relit.mask[..., None]], 2)
        .astype(np.float32)
        .transpose(2, 0, 1)
    )
    factor = (
        LONG_SIDE
        / _OBJECT
        / narrow.max()
        * (1.0 if rng.random() < 0.6 else log_uniform(rng, 0.7, 1.02))
    )
    size = [max(8, round(SIZE * factor * part)) for part in narrow[::-1]]
    layers = functional.interpolate(
        layers[None], size=size, mode="bilinear", antialias=True, align_corners=False
    )[0]
    turn = int(rng.integers(1, 4)) if rng.random() < 0.3 else 0
    layers = layers.rot90(turn, (1, 2))
    light, normal, cover = layers[:3], layers[3:6], layers[6:]
    for _ in range(turn):
        normal = torch.stack([-normal[1], normal[0], normal[2]])
    layers = torch.cat([light, normal, cover])
    if mirror:
        layers = layers.flip(2) * torch.tensor([1.0, 1, 1, -1, 1, 1, 1])[:, None, None]
    layers = _placed(layers, rng)
    mask = (layers[6] > 0.98).float()
    covered = functional.avg_pool2d(mask[None], CELL)
    cells = functional.avg_pool2d(layers[3:6] * mask, CELL) / covered.clamp(min=1e-3)
    return inputs(sensed(layers[:3], mask, rng)[None], mask[None, None])[0], cells, covered


def _placed(layers: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Layers (C, h, w) somewhere in a picture (C, side, side); the middle of those that are larger."""
    for axis in (1, 2):
        beyond = layers.shape[axis] - _SIDE
        layers = layers.narrow(axis, beyond // 2, _SIDE) if beyond > 0 else layers
    (top, bottom), (left, right) = (_divided(_SIDE - n, rng) for n in layers.shape[1:])
    return functional.pad(layers, (left, right, top, bottom))


def _divided(room: int, rng: np.random.Generator) -> tuple[int, int]:
    first = int(rng.integers(room + 1))
    return first, room - first


class Network(nn.Module):  # type: ignore[misc]
    """The network of `isc_core.networks.normal_network`, to be fitted; it begins with the encoder of the lamp
    network that ships.
    """

    def __init__(self) -> None:
        super().__init__()
        lamps = shipped_lamp_network()
        self.down = encoder_of(lamps.weights, lamps.biases)
        wide = [one.out_channels for one in list(self.down)[1::2]]
        self.up = nn.ModuleList(
            [Block(fine + coarse, fine) for fine, coarse in zip(wide[1:-1], wide[2:], strict=True)]
        )
        self.out = nn.Conv2d(wide[1], 4, 3, padding=1)
        for module in [*self.up.modules(), self.out]:
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
                nn.init.zeros_(module.bias)
        self.out.weight.data *= 0.1

    def forward(self, layer: torch.Tensor) -> torch.Tensor:
        """Mean normals and the logarithm of their deviation (B, 4, side / CELL, side / CELL), of
        (B, 4, side, side).
        """
        layer, kept = (
            functional.pixel_unshuffle(layer.contiguous(memory_format=torch.channels_last), 2),
            [],
        )
        with torch.autocast("cpu", torch.bfloat16, enabled=self.training):
            for level in range(len(self.down) // 2):
                layer = functional.avg_pool2d(layer, 2) if level else layer
                for one in self.down[2 * level : 2 * level + 2]:
                    layer = functional.relu(one(layer))
                kept.append(layer)
            for level in range(len(self.up) - 1, -1, -1):
                layer = self.up[level](
                    torch.cat(
                        [
                            kept[level + 1],
                            functional.interpolate(layer, scale_factor=2, mode="nearest"),
                        ],
                        1,
                    )
                )
            return self.out(layer).float()

    def arrays(self) -> dict[str, np.ndarray]:
        """As `isc_core.networks.normal_network.read_shape_network` reads them."""
        return arrays_of(
            [
                *self.down,
                *(one for block in reversed(self.up) for one in (block.c1, block.c2)),
                self.out,
            ]
        )


def loss_of(network: Network, batch: list[torch.Tensor]) -> tuple[torch.Tensor, list[float]]:
    """The loss of the module's docstring, and its parts."""
    picture, normals, cover = batch
    found = network(picture)
    error, share = (
        (found[:, :3] - normals) ** 2,
        cover / cover.sum((1, 2, 3), keepdim=True).clamp(min=1) / len(cover),
    )
    unsure = found[:, 3:].clamp(SURE, UNSURE)
    shaped = (error.sum(1, keepdim=True) * share).sum()
    likely = (
        (0.5 * error[:, :2].sum(1, keepdim=True).detach() * torch.exp(-2 * unsure) + 2 * unsure)
        * share
    ).sum()
    return shaped + _LIKELIHOOD * likely, [float(part.detach()) for part in (shaped, likely)]


def fit(objects: list[Relit], measured: list[Relit], given: argparse.Namespace) -> Network:
    """The fitted network, its weights averaged over the last steps; see `network_fitting`."""
    torch.manual_seed(given.seed)
    torch.set_num_threads(given.threads)
    network = Network().to(memory_format=torch.channels_last)
    if given.start is not None:
        network.load_state_dict(torch.load(given.start, weights_only=True))
    batches = iter(
        torch.utils.data.DataLoader(
            Draws(objects, measured, given.seed), batch_size=None, num_workers=1, prefetch_factor=8
        )
    )
    return optimised(network, network.down, batches, loss_of, given)


def main() -> None:
    """Fits and writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("objects", type=Path, nargs="+")
    parser.add_argument("--measured", type=Path, metavar="DIR")
    parser.add_argument("--leave", nargs="+", default=[])
    parser.add_argument("--steps", type=int, default=7000)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument(
        "--start",
        type=Path,
        metavar="STATE.pt",
        help="weights to go on from, as are written beside the output",
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()

    def seen(folder: Path) -> list[Relit]:
        return [Relit.of(unlit) for unlit in objects_in(folder) if unlit.shape not in given.leave]

    objects = [relit for folder in given.objects for relit in seen(folder)]
    if not objects:
        parser.error(
            "there is nothing to learn from: make objects with training.data.traced_objects"
        )
    given.output.parent.mkdir(parents=True, exist_ok=True)
    network = fit(objects, [] if given.measured is None else seen(given.measured), given)
    np.savez_compressed(given.output, **network.arrays())  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
