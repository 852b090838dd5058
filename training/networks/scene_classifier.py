"""Fits the network of `isc_core.networks.scene_classifier`.

  python -m training.networks.scene_classifier SCENES... --synth DIR [--data ROOT --glossy DIR...]
  [--leave NAME...] -o APPEARANCE.npz

SCENES: of `training.data.rendered_scenes`; `--synth`: a run of `isc synth`, whose training scenes are
ordinary; `--data`, `--glossy`: the MIT-Berkeley set and what `isc synth glossy-mit` made of it,
ordinary too; `--leave`: families of shapes, objects of the set and surroundings that the network
must not see, because it will be measured on them (`benchmarks.decomposition.assumption_checks`). `--start`: a layer network,
whose encoder it begins with (the shipped one if none): what that has seen, `--leave` does not take
back. Needs PyTorch (`pip install 'isc3d[training]'`), which nothing else of ISC does.

Scenes whose second lamp is nearly as strong as the first, and surroundings with several windows or
softboxes, may be called ordinary or "lamps": of them the loss is -log of the sum. Each photo is
drawn anew at another size, turned, noisier, brighter than the sensor's most, tinted; of a rig of
lamps one or several are lit.

Loss: -log probability, every kind about as often. Adam with decoupled weight decay (I. Loshchilov
and F. Hutter 2019, arXiv:1711.05101), a cosine of steps, averaged weights.
"""

import argparse
import copy
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.imaging.bounding_box import mask_slices
from isc_core.io.exr import read_channels
from isc_core.networks.layer_network import read_network, shipped_network
from isc_core.networks.scene_classifier import GLASS, KINDS, LAMPS, LONG_SIDE, MIRROR, ORDINARY
from isc_core.imaging.area_resize import averaged
from training.data.random_draws import log_uniform
from training.data.rendered_scenes import scenes_in
from training.networks.layer_network import arrays_of, encoder_of, inputs

_SIDE = 160  # of the pictures that it learns from
_ALLOWED = {
    ORDINARY: (1, 0, 0, 0), MIRROR: (0, 1, 0, 0), GLASS: (0, 0, 1, 0), LAMPS: (0, 0, 0, 1),
    "either": (1, 0, 0, 1),
}  # fmt: skip
_SHARES = {
    "synth": 0.13, "photo": 0.15, "lamp": 0.04, "place": 0.15, "matt": 0.05,
    "mirror": 0.16, "glass": 0.13, "lamps": 0.07, "rig": 0.28,
}  # fmt: skip
_SECOND_LAMP = 0.35  # of the first
_SEVERAL = (
    "room",
    "studio",
    "clutter",
    "interior",
    "night",
)  # surroundings, or panoramas of that name, with several small lights
_RATE, _HEAD_RATE, _DECAY, _WARM_UP, _BATCH = 3e-4, 1.5e-3, 1e-2, 50, 12
_SMOOTHING = 0.02
_LARGEST = 6e4  # of half precision


@dataclass(frozen=True)
class Subject:
    """`layers` (K, 3, side, side) float16, whose sum is the photo (of a rig: a lamp each, and light
    from around); `mask` (side, side); `truth`: of `_ALLOWED`, "" for rigs; `group`: of `_SHARES`;
    `family`: of shapes, or an object of the set; `around`: its surroundings.
    """

    layers: torch.Tensor
    mask: torch.Tensor
    truth: str
    group: str
    family: str
    around: str = ""


def rendered(folder: Path) -> Iterator[Subject]:
    """The scenes of `training.data.rendered_scenes`."""
    for scene in scenes_in(folder):
        truth = (
            scene.kind
            if scene.kind in KINDS
            else "either"
            if scene.kind == "place" and scene.surroundings in _SEVERAL
            else ORDINARY
        )
        layers, mask = _packed(scene.layers, scene.mask)
        yield Subject(
            layers,
            mask,
            "" if scene.kind == "rig" else truth,
            scene.kind,
            scene.shape,
            scene.surroundings,
        )


def synthetic(run: Path) -> Iterator[Subject]:
    """The training scenes of a run of `isc synth`."""
    for path in sorted((run / "train").rglob("maps.exr")):
        record = json.loads((path.parent / "scene.json").read_text(encoding="utf-8"))
        truth = (
            "either"
            if _second_lamp(record["light"].get("sources", [])) > _SECOND_LAMP
            else ORDINARY
        )
        channels = read_channels(path)
        image = np.stack([channels[f"image.{letter}"] for letter in "RGB"], -1)
        yield Subject(
            *_packed(image[None], channels["mask.A"] > 0.5),
            truth,
            "synth",
            record["object"]["family"],
        )


def photographed(data: Path, glossy: Sequence[Path]) -> Iterator[Subject]:
    """The set's objects as photographed, with gloss and without, under natural lights, and under
    all lights of `isc synth glossy-mit`.
    """
    kinds = [
        (data, "laboratory", "original"),
        (data, "laboratory", "diffuse"),
        (data, "natural", "diffuse"),
    ]
    kinds += [
        (folder, "laboratory", "original")
        for run in glossy
        for folder in sorted(run.glob("level-*"))
    ]
    for root, light, layer in kinds:
        for name in list_objects(root, light):
            seen = load_object(root, name, light, layer)
            yield Subject(
                *_packed(np.maximum(seen.image, 0)[None], seen.valid), ORDINARY, "photo", name
            )


def _second_lamp(sources: list[dict[str, Any]]) -> float:
    """How strong the second lamp is, relative to the first."""
    lamps = [0.0, 0.0]
    for source in sources:
        if source["kind"] == "directional":
            lamps.append(np.mean(source["irradiance"]))
        elif source["kind"] == "point":
            lamps.append(np.mean(source["intensity"]) / np.square(source["position"]).sum())
        elif source["kind"] == "panel":
            area = 4 * np.linalg.norm(source["right"]) * np.linalg.norm(source["up"])
            lamps.append(np.mean(source["radiance"]) * area / np.square(source["centre"]).sum())
    second, first = sorted(lamps)[-2:]
    return float(second / first) if first > 0 else 0.0


def _packed(layers: np.ndarray, mask: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    """Layers (K, H, W, 3), at most `LONG_SIDE` pixels long, in the middle of a picture, and their
    mask.
    """
    box = mask_slices(mask)
    factor = min(1.0, LONG_SIDE / max(mask[box].shape))
    small = [averaged(layer[box], mask[box], factor) for layer in layers]
    inside = small[0][1]
    top, left = ((_SIDE - n) // 2 for n in inside.shape)
    place = np.s_[..., top : top + inside.shape[0], left : left + inside.shape[1]]
    level = float(np.mean([layer[inside].mean() for layer, _, _ in small])) + 1e-9
    packed, cover = (
        np.zeros((len(layers), 3, _SIDE, _SIDE), np.float16),
        np.zeros((_SIDE, _SIDE), np.float32),
    )
    packed[place] = np.stack(
        [np.clip(layer / level, 0, _LARGEST).transpose(2, 0, 1) for layer, _, _ in small]
    )
    cover[place] = inside
    return torch.from_numpy(packed), torch.from_numpy(cover)


def _colour(rng: np.random.Generator, strength: float) -> torch.Tensor:
    return torch.tensor(np.exp(rng.normal(0, strength, 3)), dtype=torch.float32)[:, None, None]


def _lit(subject: Subject, rng: np.random.Generator) -> tuple[torch.Tensor, str]:
    """The photo (3, side, side) and its truth; of a rig one lamp or several are lit."""
    layers = subject.layers.float()
    if subject.group != "rig":
        return layers.sum(0), subject.truth
    several, lamps = bool(rng.random() < 0.5) and len(layers) > 2, len(layers) - 1
    image = layers[-1] * log_uniform(rng, 0.02, 0.3) * _colour(rng, 0.08)
    count = int(rng.integers(2, lamps + 1)) if several else 1
    coloured = 0.6 if several and rng.random() < 0.5 else 0.05
    for lamp in rng.permutation(lamps)[:count]:
        image = image + layers[lamp] * float(rng.uniform(0.55, 1)) * _colour(rng, coloured)
    return image, LAMPS if several else ORDINARY


def draw(subject: Subject, rng: np.random.Generator) -> tuple[torch.Tensor, tuple[int, ...]]:
    """What the network sees (4, side, side) of one photo as some camera takes it, and which kinds
    are right.
    """
    image, truth = _lit(subject, rng)
    image, mask = _placed(torch.cat([image * subject.mask, subject.mask[None]]), rng)
    return inputs(sensed(image, mask, rng)[None], mask[None, None])[0], _ALLOWED[truth]


def _placed(layers: torch.Tensor, rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """At another size, mirrored, turned, elsewhere."""
    factor = log_uniform(rng, 0.6, 1.05)
    resized = functional.interpolate(
        layers[None],
        scale_factor=factor,
        mode="bilinear",
        antialias=factor < 1,
        align_corners=False,
    )[0]
    if rng.random() < 0.5:
        resized = resized.flip(2)
    if rng.random() < 0.25:
        resized = resized.rot90(int(rng.integers(1, 4)), (1, 2))
    room = _SIDE - resized.shape[1]
    if room < 0:
        resized = resized[:, -room // 2 : -room // 2 + _SIDE, -room // 2 : -room // 2 + _SIDE]
    else:
        top, left = (int(rng.integers(room + 1)) for _ in range(2))
        resized = functional.pad(resized, (left, room - left, top, room - top))
    return resized[:3], (resized[3] > 0.98).float()


def sensed(image: torch.Tensor, mask: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Noisy, clipped, tinted, with other hues or less of them."""
    noise, mean = (
        log_uniform(rng, 0.003, 0.08),
        (image * mask).sum() / (3 * mask.sum().clamp(min=1)),
    )
    if rng.random() < 0.8:
        image = (
            image * (1 + noise * torch.randn_like(image))
            + 0.3 * noise * mean * torch.randn_like(image)
        ).clamp(min=0)
    if rng.random() < 0.7 and mask.sum() > 0:
        image = image.clamp(
            max=float(torch.quantile(image.max(0).values[mask > 0], float(rng.uniform(0.92, 1))))
        )
    image = image * _colour(rng, 0.1)
    if rng.random() < 0.3:
        image = image[rng.permutation(3)]
    if rng.random() < 0.2:
        kept = float(rng.uniform(0, 1))
        image = image * kept + (1 - kept) * image.mean(0, keepdim=True)
    return image


class Network(nn.Module):  # type: ignore[misc]
    """The network of `isc_core.networks.scene_classifier`, to be fitted; it begins with the encoder of a layer
    network.
    """

    def __init__(self, start: Path | None) -> None:
        super().__init__()
        self.convolutions = encoder_of(
            *(shipped_network() if start is None else read_network(start)).encoder
        )
        count = 3 * sum(one.out_channels for one in list(self.convolutions)[1::2])
        self.scaled, self.dropped, self.head = (
            nn.BatchNorm1d(count, momentum=0.05),
            nn.Dropout(0.3),
            nn.Linear(count, len(KINDS)),
        )
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)

    def forward(self, layer: torch.Tensor) -> torch.Tensor:
        """Log odds (B, 4) of (B, 4, side, side)."""
        cover, layer, found = (
            functional.avg_pool2d(layer[:, 3:], 2),
            functional.pixel_unshuffle(layer, 2),
            [],
        )
        for level in range(len(self.convolutions) // 2):
            if level:
                layer, cover = functional.avg_pool2d(layer, 2), functional.avg_pool2d(cover, 2)
            with torch.autocast("cpu", torch.bfloat16, enabled=self.training):
                for one in self.convolutions[2 * level : 2 * level + 2]:
                    layer = functional.relu(one(layer))
            weight, values = (
                cover / cover.sum((2, 3), keepdim=True).clamp(min=1e-6),
                layer.float().clamp(max=1e4),
            )
            first, second, fourth = ((values**power * weight).sum((2, 3)) for power in (1, 2, 4))
            found += [first, (second - first**2).clamp(min=1e-6).sqrt(), (fourth + 1e-12) ** 0.25]
        return self.head(self.dropped(self.scaled(torch.sqrt(torch.cat(found, 1) + 1e-6))))

    def arrays(self) -> dict[str, np.ndarray]:
        """As `isc_core.networks.scene_classifier.read_appearance` reads them."""
        norm, head = self.scaled, self.head
        return arrays_of(self.convolutions) | {
            "middle": norm.running_mean.numpy(),
            "scale": torch.sqrt(norm.running_var + norm.eps).numpy(),
            "head": (head.weight * norm.weight).detach().numpy().T,
            "odds": (head.bias + head.weight @ norm.bias).detach().numpy(),
        }


def fit(subjects: Sequence[Subject], given: argparse.Namespace) -> Network:
    """The fitted network, its weights averaged over the last steps."""
    torch.manual_seed(given.seed)
    rng, network = np.random.default_rng(given.seed), Network(given.start)
    groups = {name: [s for s in subjects if s.group == name] for name in _SHARES}
    groups = {name: members for name, members in groups.items() if members}
    names, shares = list(groups), np.array([_SHARES[name] for name in groups])
    heads = [*network.scaled.parameters(), *network.head.parameters()]
    optimizer = torch.optim.AdamW(
        [
            {"params": network.convolutions.parameters(), "lr": _RATE},
            {"params": heads, "lr": _HEAD_RATE},
        ],
        weight_decay=_DECAY,
    )
    average, shown = copy.deepcopy(network).eval(), 0.0
    for step in range(given.steps):
        rate = min(1.0, (step + 1) / _WARM_UP) * 0.5 * (1 + math.cos(math.pi * step / given.steps))
        for group, full in zip(optimizer.param_groups, (_RATE, _HEAD_RATE), strict=True):
            group["lr"] = rate * full
        chosen = [groups[name] for name in rng.choice(names, _BATCH, p=shares / shares.sum())]
        inputs, allowed = zip(
            *(draw(members[int(rng.integers(len(members)))], rng) for members in chosen),
            strict=True,
        )
        loss = _loss(network(torch.stack(inputs)), torch.tensor(allowed, dtype=torch.float32))
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        follow(average, network, step)
        shown = 0.99 * shown + 0.01 * float(loss.detach())
        if step % 100 == 99:
            print(
                f"step {step + 1} of {given.steps}, loss {shown / (1 - 0.99 ** (step + 1)):.4f}",
                flush=True,
            )
    return average


def _loss(odds: torch.Tensor, allowed: torch.Tensor) -> torch.Tensor:
    log_share = functional.log_softmax(odds, 1)
    right = torch.logsumexp(log_share + torch.log(allowed + 1e-9), 1)
    return -((1 - _SMOOTHING) * right + _SMOOTHING * log_share.mean(1)).mean()


def follow(average: nn.Module, network: nn.Module, step: int) -> None:
    """Brings the weights of `average` nearer to those of `network`, by less and less."""
    with torch.no_grad():
        for kept, new in zip(
            average.state_dict().values(), network.state_dict().values(), strict=True
        ):
            if kept.is_floating_point():
                kept.lerp_(new, 1 - min(0.995, (step + 1) / (step + 20)))
            else:
                kept.copy_(new)


def main() -> None:
    """Fits and writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--synth", type=Path, required=True)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--glossy", type=Path, nargs="+", default=[])
    parser.add_argument("--start", type=Path)
    parser.add_argument("--leave", nargs="+", default=[])
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    subjects = [
        *synthetic(given.synth),
        *(subject for folder in given.scenes for subject in rendered(folder)),
    ]
    subjects += photographed(given.data, given.glossy) if given.data else ()
    subjects = [
        subject for subject in subjects if not {subject.family, subject.around} & set(given.leave)
    ]
    if not subjects:
        parser.error(
            "there is nothing to learn from: make scenes with training.data.rendered_scenes and isc synth"
        )
    given.output.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(given.output, **fit(subjects, given).arrays())  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
