"""Samples for the layer network: glossy objects with known layers, varied at random.

Equation: an object is kept as four layers: diffuse light, specular light, shading and reflectance.
A sample is drawn from one at another size, place and orientation; with the reflectance of any other
object, less colour or other hues; with stronger, weaker or no gloss; under a tinted light; with
clipping, noise or blur. Thus a few hundred objects give any number of photos.

Limits: the objects are scenes of `isc synth` (32-bit layers) and, if available, the MIT-Berkeley
objects, as photographed and with the gloss of `isc synth glossy-mit`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.io.exr import read_channels

from .augmentation import INSIDE, clipped, colour_factor, less_saturated, placed_in_square, rescaled
from .packing import as_half, pack_object
from .random_draws import log_uniform

SIZE, CROP = 192, 160  # pixels: of a stored object, of a sample
_LONG_SIDE = 176  # of an object that is larger
_NO_GLOSS = 1e-5  # mean specular light below which an object counts as diffuse
_DIFFUSE, _SPECULAR, _SHADING = slice(0, 3), slice(3, 6), slice(6, 9)
_REFLECTANCE, _MASK = slice(9, 12), slice(12, 13)

# image (3, H, W), diffuse (3, H, W), mask (1, H, W)
Sample = tuple[torch.Tensor, torch.Tensor, torch.Tensor]


@dataclass(frozen=True)
class LayeredObject:
    """An object with known layers.

    Attributes
    ----------
    layers : (13, SIZE, SIZE) tensor
        float16: diffuse, specular, shading, reflectance, mask.
    name : str
        Name of the data set's object, or "" for a rendered one.
    family : str
        Name that no two objects share unless they are versions of one.
    """

    layers: torch.Tensor
    name: str = ""
    family: str = ""


def rendered_objects(folder: Path) -> Iterator[LayeredObject]:
    """Read the training scenes of a run of `isc synth`, ordered by name.

    Held-out objects, materials and lights are left out.

    Parameters
    ----------
    folder : Path
        Output folder of the run.

    Returns
    -------
    iterator of LayeredObject
    """
    for path in sorted((folder / "train").rglob("maps.exr")):
        channels = read_channels(path)
        image, specular, shading, reflectance = (
            np.stack([channels[f"{layer}.{letter}"] for letter in "RGB"], -1)
            for layer in ("image", "specular", "shading", "reflectance")
        )
        layers = (image - specular, specular, shading, reflectance)
        yield LayeredObject(_packed(layers, channels["mask.A"] > 0.5), "", str(path.parent))


def photographed_objects(data: Path, glossy: Sequence[Path]) -> Iterator[LayeredObject]:
    """Read the MIT-Berkeley objects and their glossy versions.

    Parameters
    ----------
    data : Path
        The MIT-Berkeley set.
    glossy : sequence of Path
        Runs of `isc synth glossy-mit`. One level of gloss is read: samples scale it anyway.

    Yields
    ------
    LayeredObject
        Each object as photographed, and under each light of each run.
    """
    for root in (data, *(folder for run in glossy for folder in sorted(run.glob("level-25_*")))):
        for name in list_objects(root, "laboratory"):
            photo, diffuse = (
                load_object(root, name, "laboratory", kind) for kind in ("original", "diffuse")
            )
            gloss = np.maximum(photo.image - diffuse.image, 0)
            layers = (diffuse.image, gloss, diffuse.shading, diffuse.reflectance)
            yield LayeredObject(_packed(layers, photo.valid), name, name)


def draw_sample(objects: Sequence[LayeredObject], chosen: int, rng: np.random.Generator) -> Sample:
    """Draw a photo of an object and its diffuse layer.

    Parameters
    ----------
    objects : sequence of LayeredObject
        The others lend their reflectance.
    chosen : int
        Index of the object.
    rng : np.random.Generator
        Draws the variation.

    Returns
    -------
    image, diffuse : (3, CROP, CROP) tensor
        Linear light, 0 outside the mask.
    mask : (1, CROP, CROP) tensor
        1 on the object.
    """
    layers = _transformed(objects[chosen].layers.float(), rng)
    diffuse, specular = layers[_DIFFUSE], layers[_SPECULAR]
    mask = (layers[_MASK] > INSIDE).float()
    if rng.random() < 0.4:
        other = objects[int(rng.integers(len(objects)))].layers.float()
        diffuse = _random_reflectance(other, rng) * layers[_SHADING]
    diffuse = _recoloured(diffuse, rng)
    count = mask.sum().clamp(min=1)
    level = ((diffuse * mask).mean(0).sum() / count).clamp(min=1e-6)
    mean_specular = float((specular * mask).mean(0).sum() / count)
    specular = specular * _specular_factor(mean_specular, float(level), rng)
    diffuse = diffuse / level
    tint = np.exp(rng.normal(0, 0.15, 3))
    specular_tint = np.exp(rng.normal(0, 0.05 if rng.random() < 0.7 else 0.2, 3))
    diffuse = diffuse * colour_factor(tint)
    specular = specular * colour_factor(tint * specular_tint)
    image, diffuse = _recorded(diffuse + specular, diffuse, mask, rng)
    return image * mask, diffuse * mask, mask


def _packed(layers: Sequence[np.ndarray], mask: np.ndarray) -> torch.Tensor:
    """Layers (13, SIZE, SIZE) float16, each scaled to its mean, reflectance to its brightest."""
    packed = pack_object(layers, mask, _LONG_SIDE, SIZE)
    diffuse, specular, shading, reflectance = packed.layers
    inside = packed.mask
    level = float(diffuse[:, inside].mean()) + 1e-9
    mean_shading = float(shading[:, inside].mean()) + 1e-9
    brightest = float(np.quantile(reflectance[:, inside].max(0), 0.99)) + 1e-9
    scaled = (diffuse / level, specular / level, shading / mean_shading, reflectance / brightest)
    return torch.from_numpy(as_half(np.concatenate([*scaled, inside[None].astype(np.float32)])))


def _transformed(layers: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """The layers at another size and place, mirrored, rotated by multiples of 90 degrees."""
    layers = rescaled(layers, log_uniform(rng, 0.7, 1.25))
    if rng.random() < 0.5:
        layers = layers.flip(2)
    if rng.random() < 0.25:
        layers = layers.flip(1)
    if rng.random() < 0.3:
        layers = layers.rot90(int(rng.integers(1, 4)), (1, 2))
    return placed_in_square(layers, CROP, rng)


def _random_reflectance(layers: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Another object's reflectance (3, CROP, CROP); beyond its mask, the mean."""
    reflectance, mask = layers[_REFLECTANCE], layers[_MASK]
    mean = (reflectance * mask).sum((1, 2)) / mask.sum().clamp(min=1)
    filled = torch.where(mask > 0.5, reflectance, mean[:, None, None])
    reflectance = rescaled(filled, log_uniform(rng, 0.6, 2.2))
    while min(reflectance.shape[1:]) < CROP:
        reflectance = torch.cat([reflectance, reflectance.flip(1)], 1)
        reflectance = torch.cat([reflectance, reflectance.flip(2)], 2)
    top, left = (int(rng.integers(n - CROP + 1)) for n in reflectance.shape[1:])
    reflectance = reflectance[:, top : top + CROP, left : left + CROP]
    if rng.random() < 0.3:
        return reflectance.clamp(min=0.01) ** float(rng.uniform(0.5, 1.5))
    return reflectance


def _recoloured(diffuse: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Sometimes less saturated, sometimes with permuted channels."""
    if rng.random() < 0.35:
        diffuse = less_saturated(diffuse, rng)
    return diffuse[rng.permutation(3)] if rng.random() < 0.3 else diffuse


def _specular_factor(specular: float, level: float, rng: np.random.Generator) -> float:
    """The factor of a specular layer of mean `specular`: none, unchanged, or a drawn share."""
    case = rng.random()
    if specular < _NO_GLOSS or case < 0.2:
        return 0.0
    if case < 0.45 and level < 50:
        return 1 / level
    share = log_uniform(rng, 0.02, 0.45)
    return min(share / (1 - share) / specular, 40.0)


def _recorded(
    image: torch.Tensor, diffuse: torch.Tensor, mask: torch.Tensor, rng: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    """The photo and its diffuse layer after clipping, noise and blur."""
    if rng.random() < 0.3:
        image = clipped(image, mask[0], 0.95, 0.999, rng)
        diffuse = torch.minimum(diffuse, image)
    if rng.random() < 0.6:
        noise = log_uniform(rng, 0.002, 0.03)
        relative = image * (1 + noise * torch.randn_like(image))
        image = (relative + 0.3 * noise * torch.randn_like(image)).clamp(min=1e-4)
    if rng.random() < 0.15:
        image, diffuse = (_blurred(layer) for layer in (image, diffuse))
    return image, diffuse


def _blurred(layer: torch.Tensor) -> torch.Tensor:
    padded = functional.pad(layer[None], (1, 1, 1, 1), mode="replicate")
    return functional.avg_pool2d(padded, 3, 1)[0]
