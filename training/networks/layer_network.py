"""Fits the network of `isc_core.networks.layer_network`.

  python -m training.networks.layer_network --scenes DIR [--data ROOT --glossy DIR... [--leave
  a,b]] -o NETWORK.npz [--steps N]

`--scenes`: a folder of `isc synth`. `--data`, `--glossy`: the MIT-Berkeley set and what `isc synth
glossy-mit` made of it; `--leave`: objects that the network must not see, because it will be
measured on them. Needs PyTorch (`pip install 'isc3d[training]'`), which nothing else of ISC does.
With `--start STATE` the fit goes on from the state that an earlier run kept beside its network
(NETWORK.pt).

Loss, of y = log(image / diffuse): .3 |e| + .7 Huber(e) + .5 |gradient of e|, each pixel weighted by
its light, each photo by 1 / (.1 + mean y), so that weak highlights count too; and the Laplace
likelihood of |e| for the scale b. What all pixels have in common (the tenth percentile of each
channel's y) is taken off: a veil cannot be told from brighter light. Adam with decoupled weight
decay (I. Loshchilov and F. Hutter 2019, arXiv:1711.05101), a cosine of steps, averaged weights;
He's initial weights (K. He et al. 2015, doi:10.1109/ICCV.2015.123).
"""

import argparse
import copy
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from training.data.layered_objects import Subject, draw, photographed, rendered

WIDTHS = (32, 48, 64, 96, 128)
_DARK, _MARGIN = 0.03, 2.0  # as in layer_network
_RATE, _DECAY, _WARM_UP = 8e-4, 1e-3, 200
_COMMON, _MOST = 0.1, 3.0
_SHARE = 0.4  # of the samples that are of the set's objects
_HUBER = 0.4


class Block(nn.Module):  # type: ignore[misc]
    """Two convolutions with max(0, .)."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.c1, self.c2 = (
            nn.Conv2d(inputs, outputs, 3, padding=1),
            nn.Conv2d(outputs, outputs, 3, padding=1),
        )

    def forward(self, layer: torch.Tensor) -> torch.Tensor:
        """(B, inputs, H, W) to (B, outputs, H, W)."""
        return functional.relu(self.c2(functional.relu(self.c1(layer))))


class Network(nn.Module):  # type: ignore[misc]
    """The network of `isc_core.networks.layer_network`, to be fitted."""

    def __init__(self) -> None:
        super().__init__()
        steps = list(zip(WIDTHS[:-1], WIDTHS[1:], strict=True))
        self.down = nn.ModuleList(
            [Block(16, WIDTHS[0]), *(Block(fine, coarse) for fine, coarse in steps)]
        )
        self.up = nn.ModuleList([Block(fine + coarse, fine) for fine, coarse in steps])
        self.out = nn.Conv2d(WIDTHS[0], 16, 3, padding=1)
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
                nn.init.zeros_(module.bias)
        self.out.weight.data *= 0.1

    def forward(self, layer: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """y (B, 3, H, W) and log b (B, 1, H, W) of inputs (B, 4, H, W)."""
        layer, kept = functional.pixel_unshuffle(layer, 2), []
        for level, block in enumerate(self.down):
            layer = block(layer if level == 0 else functional.avg_pool2d(layer, 2))
            kept.append(layer)
        for level in range(len(self.up) - 1, -1, -1):
            layer = self.up[level](
                torch.cat(
                    [kept[level], functional.interpolate(layer, scale_factor=2, mode="nearest")], 1
                )
            )
        raw = functional.pixel_shuffle(self.out(layer), 2)
        return functional.softplus(raw[:, :3] - _MARGIN), raw[:, 3:]

    def arrays(self) -> dict[str, np.ndarray]:
        """As `layer_network.read_network` reads them."""
        blocks = [*self.down, *reversed(self.up)]
        return arrays_of([layer for block in blocks for layer in (block.c1, block.c2)] + [self.out])


def encoder_of(weights: Sequence[np.ndarray], biases: Sequence[np.ndarray]) -> nn.ModuleList:
    """The convolutions of an encoder of `isc_core.networks.layers`, to begin another
    network with.
    """
    convolutions = nn.ModuleList()
    for weight, bias in zip(weights, biases, strict=True):
        one = nn.Conv2d(weight.shape[1], weight.shape[2], 3, padding=1)
        one.weight.data.copy_(
            torch.from_numpy(weight.reshape(3, 3, *weight.shape[1:]).transpose(3, 2, 0, 1).copy())
        )
        one.bias.data.copy_(torch.from_numpy(bias))
        convolutions.append(one)
    return convolutions


def arrays_of(convolutions: Iterable[nn.Conv2d]) -> dict[str, np.ndarray]:
    """Weights and biases as `isc_core.networks.layers.weights_in` reads them."""
    found: dict[str, np.ndarray] = {}
    for k, one in enumerate(convolutions):
        weight = one.weight.detach().numpy().transpose(2, 3, 1, 0)
        found[f"weight{k:02d}"] = weight.reshape(9, *weight.shape[2:]).astype(np.float16)
        found[f"bias{k:02d}"] = one.bias.detach().numpy().astype(np.float16)
    return found


class Draws(torch.utils.data.IterableDataset[list[torch.Tensor]]):  # type: ignore[misc]
    """Batches without end."""

    def __init__(self, subjects: list[Subject], batch: int, seed: int) -> None:
        self._subjects, self._batch, self._seed = subjects, batch, seed

    def __iter__(self) -> Iterator[list[torch.Tensor]]:
        torch.set_num_threads(1)
        torch.manual_seed(self._seed)
        rng = np.random.default_rng(self._seed)
        groups = [
            g
            for g in (
                [k for k, s in enumerate(self._subjects) if bool(s.name) == named]
                for named in (False, True)
            )
            if g
        ]
        while True:
            chosen = [groups[-1 if rng.random() < _SHARE else 0] for _ in range(self._batch)]
            photos = [draw(self._subjects, int(rng.choice(group)), rng) for group in chosen]
            yield [torch.stack(layers) for layers in zip(*photos, strict=True)]


def inputs(image: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """(B, 4, H, W): log light over each object's mean, and the mask."""
    mean = (image.mean(1, keepdim=True) * mask).sum((2, 3), keepdim=True) / mask.sum(
        (2, 3), keepdim=True
    ).clamp(min=1)
    return torch.cat([torch.log(image / mean.clamp(min=1e-9) + _DARK) * mask, mask], 1)


def wanted(image: torch.Tensor, diffuse: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """y (B, 3, H, W), without what all of an object's pixels have in common."""
    excess = (torch.log(image.clamp(min=1e-5)) - torch.log(diffuse.clamp(min=1e-5))).clamp(0, _MOST)
    ordered = (
        torch.where(mask.expand_as(excess) > 0, excess, torch.full_like(excess, 3 * _MOST))
        .flatten(2)
        .sort(2)
        .values
    )
    place = (_COMMON * mask.sum((2, 3))).long().clamp(min=1)[:, :, None].expand(-1, 3, 1)
    return (excess - ordered.gather(2, place)[..., None].clamp(max=_MOST)).clamp(min=0)


def loss_of(
    found: torch.Tensor,
    log_scale: torch.Tensor,
    image: torch.Tensor,
    diffuse: torch.Tensor,
    mask: torch.Tensor,
) -> torch.Tensor:
    """The loss of the module's docstring."""
    target = wanted(image, diffuse, mask)
    light = image.mean(1, keepdim=True)
    mean = (light * mask).sum((2, 3), keepdim=True) / mask.sum((2, 3), keepdim=True).clamp(min=1)
    weight = mask * (light / mean.clamp(min=1e-6)).clamp(0.1, 1)
    weight = weight / weight.sum((2, 3), keepdim=True).clamp(min=100)
    error, log_scale = found - target, log_scale.clamp(-4, 2)
    size = error.abs()
    huber = torch.where(size < _HUBER, size * size / _HUBER, 2 * size - _HUBER)
    size, huber = size.mean(1, keepdim=True), huber.mean(1, keepdim=True)
    level = (target.mean(1, keepdim=True) * weight).sum((1, 2, 3))
    fit = ((0.3 * size + 0.7 * huber) * weight).sum((1, 2, 3)) + 0.5 * _steps(error, mask)
    likelihood = ((size.detach() / log_scale.exp() + log_scale) * weight).sum((1, 2, 3))
    return (fit * 0.2 / (0.1 + level) + 0.05 * likelihood).mean()


def _steps(error: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Mean size (B,) of the error's steps from pixel to pixel."""
    count = mask.sum((1, 2, 3)).clamp(min=100)
    across = (error[..., 1:] - error[..., :-1]).abs() * mask[..., 1:] * mask[..., :-1]
    down = (error[..., 1:, :] - error[..., :-1, :]).abs() * mask[..., 1:, :] * mask[..., :-1, :]
    return (across.mean(1).sum((1, 2)) + down.mean(1).sum((1, 2))) / count


def fit(subjects: list[Subject], given: argparse.Namespace) -> Network:
    """The averaged network after `given.steps` steps."""
    torch.manual_seed(given.seed)
    network = Network()
    if given.start:
        network.load_state_dict(torch.load(given.start, weights_only=True))
    average = copy.deepcopy(network)
    optimizer = torch.optim.AdamW(network.parameters(), lr=_RATE, weight_decay=_DECAY)
    batches: Any = torch.utils.data.DataLoader(
        Draws(subjects, given.batch, given.seed), batch_size=None, num_workers=1, prefetch_factor=4
    )
    shown = 0.0
    for step, (image, diffuse, mask) in zip(range(given.steps), batches, strict=False):
        rate = (
            _RATE
            * min(1.0, (step + 1) / _WARM_UP)
            * 0.5
            * (1 + math.cos(math.pi * step / given.steps))
            + 1e-6
        )
        for group in optimizer.param_groups:
            group["lr"] = rate
        with torch.autocast("cpu", torch.bfloat16):
            found, log_scale = network(inputs(image, mask))
        loss = loss_of(found.float(), log_scale.float(), image, diffuse, mask)
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        with torch.no_grad():
            for kept, new in zip(average.parameters(), network.parameters(), strict=True):
                kept.lerp_(new, 1 - min(0.999, (step + 1) / (step + 101)))
        shown = 0.99 * shown + 0.01 * float(loss.detach())
        if step % 100 == 99:
            print(
                f"step {step + 1} of {given.steps}, loss {shown / (1 - 0.99 ** (step + 1)):.4f}",
                flush=True,
            )
            write(average, given.output)
    return average


def write(network: Network, path: Path) -> None:
    """The network as the package reads it, and beside it the state from which a fit can go on."""
    np.savez_compressed(path, **network.arrays())  # type: ignore[arg-type]
    torch.save(network.state_dict(), path.with_suffix(".pt"))


def main() -> None:
    """Fits and writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=Path, required=True)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--glossy", type=Path, nargs="+")
    parser.add_argument("--leave", type=lambda text: text.split(","), default=[])
    parser.add_argument("--start", type=Path)
    parser.add_argument("--steps", type=int, default=12000)
    parser.add_argument("--batch", type=int, default=10)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    if given.threads:
        torch.set_num_threads(given.threads)
    subjects = list(rendered(given.scenes))
    if given.data and given.glossy:
        subjects += [s for s in photographed(given.data, given.glossy) if s.name not in given.leave]
    given.output.parent.mkdir(parents=True, exist_ok=True)
    write(fit(subjects, given), given.output)


if __name__ == "__main__":
    main()
