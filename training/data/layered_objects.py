"""What the layer network learns from: glossy objects whose layers are known, varied at random.

Each object is kept as four layers of 192 x 192 pixels: diffuse light, specular light, shading and
paint. A sample is drawn from one: at another size, mirrored or turned, under another paint (that of
any other object), with less colour, other hues, the gloss stronger, weaker or gone, a tinted light,
full or noisy sensors, out of focus. So a few hundred objects give as many photos as one has time
for.

Objects: the scenes of `isc synth` (32 bit layers), and, where they are at hand, the MIT-Berkeley
objects under the glosses of `isc synth glossy-mit` and as photographed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.io.exr import read_channels
from isc_core.imaging.area_resize import averaged

from .random_draws import log_uniform

SIZE, CROP = 192, 160
_LONG_SIDE = 176  # of an object that is larger
_LEAST = 1e-5
_LARGEST = 6e4  # of half precision
_DIFFUSE, _SPECULAR, _SHADING, _PAINT, _MASK = (
    slice(0, 3),
    slice(3, 6),
    slice(6, 9),
    slice(9, 12),
    slice(12, 13),
)

Photo = tuple[
    torch.Tensor, torch.Tensor, torch.Tensor
]  # image (3, H, W), diffuse (3, H, W), mask (1, H, W)


@dataclass(frozen=True)
class Subject:
    """An object's layers (13, SIZE, SIZE) float16: diffuse, specular, shading, paint, mask.

    `name`: of a set's object, or "".
    """

    layers: torch.Tensor
    name: str = ""


def rendered(folder: Path) -> Iterator[Subject]:
    """The scenes below a folder of `isc synth`, in the order of their names; those of held-out
    objects, materials and lights left out.
    """
    for path in sorted((folder / "train").rglob("maps.exr")):
        channels = read_channels(path)
        image, specular, shading, paint = (
            np.stack([channels[f"{layer}.{letter}"] for letter in "RGB"], -1)
            for layer in ("image", "specular", "shading", "reflectance")
        )
        yield Subject(_packed(image - specular, specular, shading, paint, channels["mask.A"] > 0.5))


def photographed(data: Path, glossy: Sequence[Path]) -> Iterator[Subject]:
    """The set's objects as photographed, and under each light of each run of `isc synth glossy-mit`
    (one level: gloss is scaled anyway).
    """
    for root in (data, *(folder for run in glossy for folder in sorted(run.glob("level-25_*")))):
        for name in list_objects(root, "laboratory"):
            seen, matt = (
                load_object(root, name, "laboratory", kind) for kind in ("original", "diffuse")
            )
            valid, gloss = seen.valid, np.maximum(seen.image - matt.image, 0)
            yield Subject(_packed(matt.image, gloss, matt.shading, matt.reflectance, valid), name)


def _packed(
    diffuse: np.ndarray,
    specular: np.ndarray,
    shading: np.ndarray,
    paint: np.ndarray,
    mask: np.ndarray,
) -> torch.Tensor:
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    factor = min(1.0, _LONG_SIDE / max(mask[box].shape))
    small = [
        averaged(layer[box], mask[box], factor) for layer in (diffuse, specular, shading, paint)
    ]
    inside = small[0][1]
    level = float(small[0][0][inside].mean()) + 1e-9
    scales = (
        level,
        level,
        float(small[2][0][inside].mean()) + 1e-9,
        float(np.quantile(small[3][0][inside].max(-1), 0.99)) + 1e-9,
    )
    packed = np.zeros((13, SIZE, SIZE), np.float16)
    top, left = ((SIZE - n) // 2 for n in inside.shape)
    place = np.s_[:, top : top + inside.shape[0], left : left + inside.shape[1]]
    layers = [
        np.clip(layer / scale, 0, _LARGEST).transpose(2, 0, 1)
        for (layer, _, _), scale in zip(small, scales, strict=True)
    ]
    packed[place] = np.concatenate([*layers, inside[None]])
    return torch.from_numpy(packed)


def draw(subjects: list[Subject], chosen: int, rng: np.random.Generator) -> Photo:
    """One photo of `subjects[chosen]`, CROP pixels wide and high, 0 outside its mask."""
    layers = _placed(subjects[chosen].layers.float(), rng)
    diffuse, specular, mask = layers[_DIFFUSE], layers[_SPECULAR], (layers[_MASK] > 0.98).float()
    if rng.random() < 0.4:
        diffuse = (
            _other_paint(subjects[int(rng.integers(len(subjects)))].layers.float(), rng)
            * layers[_SHADING]
        )
    diffuse = _recoloured(diffuse, rng)
    count = mask.sum().clamp(min=1)
    level = ((diffuse * mask).mean(0).sum() / count).clamp(min=1e-6)
    diffuse, specular = (
        diffuse / level,
        specular * _gloss(float((specular * mask).mean(0).sum() / count), float(level), rng),
    )
    tint, own = (
        np.exp(rng.normal(0, 0.15, 3)),
        np.exp(rng.normal(0, 0.05 if rng.random() < 0.7 else 0.2, 3)),
    )
    diffuse, specular = diffuse * _colour(tint), specular * _colour(tint * own)
    image, diffuse = _sensed(diffuse + specular, diffuse, mask, rng)
    return image * mask, diffuse * mask, mask


def _colour(values: np.ndarray) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float32)[:, None, None]


def _resized(layers: torch.Tensor, factor: float) -> torch.Tensor:
    return functional.interpolate(
        layers[None],
        scale_factor=factor,
        mode="bilinear",
        antialias=factor < 1,
        align_corners=False,
    )[0]


def _placed(layers: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """The layers at another size, mirrored, turned, and cut to CROP pixels or set into them."""
    layers = _resized(layers, log_uniform(rng, 0.7, 1.25))
    if rng.random() < 0.5:
        layers = layers.flip(2)
    if rng.random() < 0.25:
        layers = layers.flip(1)
    if rng.random() < 0.3:
        layers = layers.rot90(int(rng.integers(1, 4)), (1, 2))
    for axis in (1, 2):
        room = CROP - layers.shape[axis]
        start = int(rng.integers(abs(room) + 1))
        if room > 0:
            around = [0, 0, start, room - start] if axis == 1 else [start, room - start, 0, 0]
            layers = functional.pad(layers, around)
        else:
            layers = layers.narrow(axis, start, CROP)
    return layers


def _other_paint(layers: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Another object's paint (3, CROP, CROP), its mean beyond its mask."""
    paint, mask = layers[_PAINT], layers[_MASK]
    mean = (paint * mask).sum((1, 2)) / mask.sum().clamp(min=1)
    paint = _resized(
        torch.where(mask > 0.5, paint, mean[:, None, None]), log_uniform(rng, 0.6, 2.2)
    )
    while min(paint.shape[1:]) < CROP:
        paint = torch.cat([paint, paint.flip(1)], 1)
        paint = torch.cat([paint, paint.flip(2)], 2)
    top, left = (int(rng.integers(n - CROP + 1)) for n in paint.shape[1:])
    paint = paint[:, top : top + CROP, left : left + CROP]
    return paint.clamp(min=0.01) ** float(rng.uniform(0.5, 1.5)) if rng.random() < 0.3 else paint


def _recoloured(diffuse: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """With less colour, and with other hues."""
    if rng.random() < 0.35:
        kept = float(rng.uniform(0, 1))
        diffuse = kept * diffuse + (1 - kept) * diffuse.mean(0, keepdim=True)
    return diffuse[rng.permutation(3)] if rng.random() < 0.3 else diffuse


def _gloss(specular: float, level: float, rng: np.random.Generator) -> float:
    """The factor of the specular layer, of mean light `specular`: none, as it was relative to the
    diffuse `level`, or a drawn share.
    """
    kind = rng.random()
    if specular < _LEAST or kind < 0.2:
        return 0.0
    if kind < 0.45 and level < 50:
        return 1 / level
    share = log_uniform(rng, 0.02, 0.45)
    return min(share / (1 - share) / specular, 40.0)


def _sensed(
    image: torch.Tensor, diffuse: torch.Tensor, mask: torch.Tensor, rng: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    """The photo as a sensor sees it: full, noisy, out of focus."""
    if rng.random() < 0.3 and mask.sum() > 0:
        top = float(
            torch.quantile(image.max(0).values[mask[0] > 0], float(rng.uniform(0.95, 0.999)))
        )
        image = image.clamp(max=top)
        diffuse = torch.minimum(diffuse, image)
    if rng.random() < 0.6:
        noise = log_uniform(rng, 0.002, 0.03)
        image = (
            image * (1 + noise * torch.randn_like(image)) + 0.3 * noise * torch.randn_like(image)
        ).clamp(min=1e-4)
    if rng.random() < 0.15:
        image, diffuse = (
            functional.avg_pool2d(
                functional.pad(layer[None], (1, 1, 1, 1), mode="replicate"), 3, 1
            )[0]
            for layer in (image, diffuse)
        )
    return image, diffuse
