"""Fits the network of `isc_core.networks.light_network`.

  python -m training.networks.light_network OBJECTS [--leave NAME...] [--steps N] -o LAMPS.npz

OBJECTS: of `training.data.traced_objects`; every picture lights one of them anew
(`training.data.relighting`): by smooth light alone, by one lamp, or by two to four. `--leave`:
families of shapes that the network must not see, because it will be measured on them. It begins
with the encoder of the layer network that ships. Needs PyTorch (`pip install 'isc3d[training]'`),
which nothing else of ISC does.

Loss: the cross entropy of how many lamps there are; that of where they stand, their shares of the
light blurred over some degrees; so that light and shape are told apart, the squared error of the
mean normals of patches of 16 x 16 pixels; and minus the log likelihood of how the light looks
(`sirfs.seen_light`). Adam with decoupled weight decay (I. Loshchilov and F. Hutter 2019,
arXiv:1711.05101), a cosine of steps, averaged weights.
"""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.networks.layer_network import shipped_network
from isc_core.networks.light_network import CELL, LONG_SIDE, SURE, UNSURE
from isc_core.scene.light_estimate import PLACES
from isc_core.shading.spherical_harmonics import real_sh
from isc_core.sirfs.priors.predicted_light import FRONT, LOOK
from training.data.random_draws import log_uniform
from training.data.relighting import NONE, ONE, SEVERAL, Relit, draw_photo
from training.data.traced_objects import SIZE, objects_in
from training.loop import optimised
from training.networks.scene_classifier import sensed
from training.networks.layer_network import arrays_of, encoder_of, inputs

_SIDE = 128  # of the pictures that it learns from
_OBJECT = 0.9 * SIZE  # of an unlit object, its longer side
_CHANCES = (0.25, 0.4, 0.35)  # of NONE, ONE, SEVERAL
_SPREAD = math.radians(8)  # of a lamp's place
_NORMALS = 1.0  # weight of the normals in the loss
_BATCH = 32
_LOCAL, _WHOLE = 192, 256
_EVERY = 8  # pixels: one of them tells of the light
_DARKEST = 0.05  # of the mean shading: what is darker is in shadow
_RIDGE = 0.05  # how much an even light over all directions counts


class Draws(torch.utils.data.IterableDataset[tuple[torch.Tensor, ...]]):  # type: ignore[misc]
    """Batches without end: input (B, 4, side, side), lamps (B,), places (B, P), normals (B, 3, side
    / CELL, side / CELL), light (B, 8).
    """

    def __init__(self, objects: list[Relit], seed: int) -> None:
        self._objects, self._seed = objects, seed

    def __iter__(self) -> Iterator[tuple[torch.Tensor, ...]]:
        worker = torch.utils.data.get_worker_info()
        rng = np.random.default_rng([self._seed, worker.id if worker else 0])
        torch.manual_seed(self._seed + (worker.id if worker else 0))
        torch.set_num_threads(1)
        while True:
            drawn = [
                draw(self._objects[int(rng.integers(len(self._objects)))], rng)
                for _ in range(_BATCH)
            ]
            yield tuple(torch.stack(parts) for parts in zip(*drawn, strict=True))


def draw(relit: Relit, rng: np.random.Generator) -> tuple[torch.Tensor, ...]:
    """One picture as some camera takes it, and what is true of it, see `Draws`."""
    lit = draw_photo(relit, rng, int(rng.choice([NONE, ONE, SEVERAL], p=_CHANCES)))
    normals = np.zeros((*relit.mask.shape, 3), np.float32)
    normals[relit.mask] = relit.normals
    layers = torch.from_numpy(
        np.concatenate([lit.photo, normals, relit.mask[..., None]], 2)
        .astype(np.float32)
        .transpose(2, 0, 1)
    )
    factor = LONG_SIDE / _OBJECT * (1.0 if rng.random() < 0.5 else log_uniform(rng, 0.6, 1.02))
    layers = functional.interpolate(
        layers[None], scale_factor=factor, mode="bilinear", antialias=True, align_corners=False
    )[0]
    turn, mirror = int(rng.integers(1, 4)) if rng.random() < 0.15 else 0, bool(rng.random() < 0.5)
    layers, toward = layers.rot90(turn, (1, 2)), torch.from_numpy(lit.toward.astype(np.float32))
    sample = torch.from_numpy(relit.normals[::_EVERY].astype(np.float32))
    vectors = torch.cat([layers[3:6].reshape(3, -1).T, toward, sample])
    for _ in range(turn):
        vectors = torch.stack([-vectors[:, 1], vectors[:, 0], vectors[:, 2]], 1)
    if mirror:
        layers, vectors = layers.flip(2), vectors * torch.tensor([-1.0, 1, 1])
    count, side = layers[0].numel(), layers.shape[1]
    turned = vectors[:count].T.reshape(3, side, side)
    layers = torch.cat([layers[:3], turned.flip(2) if mirror else turned, layers[6:]])
    room = _SIDE - side
    top, left = (int(rng.integers(room + 1)) for _ in range(2))
    layers = functional.pad(layers, (left, room - left, top, room - top))
    mask = (layers[6] > 0.98).float()
    cells = functional.avg_pool2d(layers[3:6] * mask, CELL) / functional.avg_pool2d(
        mask[None], CELL
    ).clamp(min=1e-3)
    seen = inputs(sensed(layers[:3], mask, rng)[None], mask[None, None])[0]
    known = count + len(lit.toward)
    light = _log_light(vectors[known:].numpy(), lit.shading[::_EVERY])
    return (
        seen,
        torch.tensor(lit.lamps),
        _blurred(vectors[count:known], lit.shares),
        cells,
        torch.from_numpy(light),
    )


def _log_light(normals: np.ndarray, shading: np.ndarray) -> np.ndarray:
    """The look (8,) float32, see `sirfs.seen_light`, of the light that gives the log shading (N,)
    of unit normals (N, 3) best.
    """
    level = float(shading.mean())
    values = np.log(np.maximum(shading / max(level, 1e-9), _DARKEST))
    basis, evenly = real_sh(normals.astype(float)), real_sh(FRONT)
    matrix = basis.T @ basis / len(basis) + _RIDGE * evenly.T @ evenly / len(evenly)
    start = _RIDGE * evenly.T @ np.full(len(evenly), values.mean()) / len(evenly)
    return np.asarray(
        LOOK @ np.linalg.solve(matrix, basis.T @ values / len(basis) + start), np.float32
    )


def _blurred(toward: torch.Tensor, shares: np.ndarray) -> torch.Tensor:
    """The probabilities (P,) of PLACES; even where there is no lamp."""
    places = torch.from_numpy(PLACES.astype(np.float32))
    if not len(toward):
        return torch.full((len(places),), 1 / len(places))
    near = torch.softmax(places @ toward.T / _SPREAD**2, 0)
    return near @ torch.from_numpy(shares.astype(np.float32))


class Network(nn.Module):  # type: ignore[misc]
    """The network of `isc_core.networks.light_network`, to be fitted; it begins with the encoder of the layer
    network that ships.
    """

    def __init__(self) -> None:
        super().__init__()
        self.convolutions = encoder_of(*shipped_network().encoder)
        count = sum(one.out_channels for one in list(self.convolutions)[1::2])
        self.scaled = nn.BatchNorm1d(count, momentum=0.02)
        self.local = nn.Linear(count + 5, _LOCAL)
        self.normal = nn.Linear(_LOCAL, 3)
        self.whole = nn.Linear(3 * _LOCAL, _WHOLE)
        self.dropped = nn.Dropout(0.1)
        self.lamps, self.places, self.light = (
            nn.Linear(_WHOLE, 3),
            nn.Linear(_WHOLE, len(PLACES)),
            nn.Linear(_WHOLE, 16),
        )

    def forward(self, layer: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Log odds of lamps (B, 3) and of places (B, P), the light and the logarithm of its
        deviations (B, 16), and normals (B, 3, side / CELL, side / CELL), of (B, 4, side, side).
        """
        mask = layer[:, 3:]
        cover, layer, found = (
            functional.avg_pool2d(mask, CELL),
            functional.pixel_unshuffle(layer, 2),
            [],
        )
        for level in range(len(self.convolutions) // 2):
            if level:
                layer = functional.avg_pool2d(layer, 2)
            with torch.autocast("cpu", torch.bfloat16, enabled=self.training):
                for one in self.convolutions[2 * level : 2 * level + 2]:
                    layer = functional.relu(one(layer))
            step = 2 ** (level + 1)
            seen = layer.float()
            finer = functional.avg_pool2d(seen, CELL // step) if step < CELL else seen
            found.append(functional.interpolate(finer, scale_factor=max(1, step // CELL)))
        cells = torch.sqrt(torch.cat(found, 1).clamp(0, 1e4) + 1e-6)
        batch, channels, rows, columns = cells.shape
        flat = cells.permute(0, 2, 3, 1).reshape(-1, channels)
        weight = cover.reshape(batch, -1, 1) / cover.sum((1, 2, 3)).reshape(-1, 1, 1).clamp(
            min=1e-6
        )
        where = _where(rows, columns, weight)
        inside = torch.cat([self.scaled(flat).reshape(batch, -1, channels), where], 2)
        inside = functional.relu(self.local(inside))
        normals = self.normal(inside).permute(0, 2, 1).reshape(batch, 3, rows, columns)
        mean = (weight * inside).sum(1)
        spread = ((weight * inside**2).sum(1) - mean**2).clamp(min=1e-6).sqrt()
        most = (inside * (weight > 0.2 * weight.amax(1, keepdim=True))).amax(1)
        whole = functional.relu(self.whole(self.dropped(torch.cat([mean, spread, most], 1))))
        return self.lamps(whole), self.places(whole), self.light(whole), normals

    def arrays(self) -> dict[str, np.ndarray]:
        """As `isc_core.networks.light_network.read_lamp_network` reads them."""
        norm, found = self.scaled, {}
        scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
        found["middle"], found["scale"] = (norm.running_mean - norm.bias / scale), scale
        for name in ("local", "whole", "lamps", "places", "light"):
            one = getattr(self, name)
            found[f"{name}_weight"], found[f"{name}_bias"] = one.weight.T, one.bias
        return arrays_of(self.convolutions) | {
            name: values.detach().numpy().astype(np.float16) for name, values in found.items()
        }


def _where(rows: int, columns: int, weight: torch.Tensor) -> torch.Tensor:
    """Where each cell lies in the object: x, y, their squares and product over its extent (B, rows
    * columns, 5); `weight` (B, ., 1).
    """
    row, column = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
    place = torch.stack([column.reshape(-1), -row.reshape(-1)], 1).float()[None]
    off = place - (weight * place).sum(1, keepdim=True)
    x, y = (off / (weight * off**2).sum((1, 2), keepdim=True).clamp(min=1e-6).sqrt()).unbind(2)
    return torch.stack([x, y, x * x, y * y, x * y], 2)


def loss_of(network: Network, batch: list[torch.Tensor]) -> tuple[torch.Tensor, list[float]]:
    """The loss of the module's docstring, and its parts."""
    picture, lamps, places, normals, light = batch
    odds, where, told, shape = network(picture)
    count = functional.cross_entropy(odds, lamps)
    lit = lamps != NONE
    place = -(places * functional.log_softmax(where, 1)).sum(1)[lit].mean()
    cover = functional.avg_pool2d(picture[:, 3:], CELL)
    shaped = (((shape - normals) ** 2).sum(1, keepdim=True) * cover).sum() / cover.sum()
    unsure = told[:, 8:].clamp(SURE, UNSURE)
    lit_by = (0.5 * ((light - told[:, :8]) * torch.exp(-unsure)) ** 2 + unsure).mean()
    return count + place + _NORMALS * shaped + lit_by, [
        float(part.detach()) for part in (count, place, shaped, lit_by)
    ]


def fit(objects: list[Relit], given: argparse.Namespace) -> Network:
    """The fitted network, its weights averaged over the last steps; see `network_fitting`."""
    torch.manual_seed(given.seed)
    torch.set_num_threads(given.threads)
    network = Network()
    if given.start is not None:
        known = torch.load(given.start, weights_only=True)
        network.load_state_dict(
            {name: part for name, part in known.items() if not name.startswith("light")},
            strict=False,
        )
    batches = iter(
        torch.utils.data.DataLoader(
            Draws(objects, given.seed), batch_size=None, num_workers=1, prefetch_factor=8
        )
    )
    return optimised(network, network.convolutions, batches, loss_of, given)


def main() -> None:
    """Fits and writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("objects", type=Path)
    parser.add_argument("--leave", nargs="+", default=[])
    parser.add_argument("--steps", type=int, default=20000)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument(
        "--start",
        type=Path,
        metavar="FILE.pt",
        help="weights to go on from, as are written beside the output",
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    objects = [
        Relit.of(unlit) for unlit in objects_in(given.objects) if unlit.shape not in given.leave
    ]
    if not objects:
        parser.error(
            "there is nothing to learn from: make objects with training.data.traced_objects"
        )
    given.output.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(given.output, **fit(objects, given).arrays())  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
