"""From light to a photo file: blur, exposure, noise, sharpening, clipping, tone curve, JPEG.

Problem: networks take artefacts of rendered pictures for signs of shape. What a camera and a file
do to a picture has to vary as it does outside.

Equation: light is scaled by the exposure, blurred and sharpened by an unsharp mask, gets noise of
variance (a I + b)^2, is clipped to [0, 1], and passed through sRGB's curve with a contrast
t -> t + c t (1 - t) (2 t - 1). JPEG quantises the discrete cosine transform of blocks of 8 x 8 with
the tables of its standard's annex K, scaled by the quality; subsampled colours are averaged over
2 x 2 pixels and interpolated, as most programs do. Then sRGB is undone, as a reader of the file
does.

Citation: ITU-T T.81 (1992), annex K (quantisation tables); E. Hamilton, "JPEG File Interchange
Format" (1992) (colour transform and scaling); IEC 61966-2-1 (sRGB).

Limits: noise is Gaussian and white.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from torch.nn import functional

from .random_draws import log_uniform

BLOCK = 8
_LUMA = (
    "16 11 10 16 24 40 51 61 12 12 14 19 26 58 60 55 14 13 16 24 40 57 69 56 "
    "14 17 22 29 51 87 80 62 18 22 37 56 68 109 103 77 24 35 55 64 81 104 113 92 "
    "49 64 78 87 103 121 120 101 72 92 95 98 112 100 103 99"
)
_CHROMA = (
    "17 18 24 47 99 99 99 99 18 21 26 66 99 99 99 99 24 26 56 99 99 99 99 99 "
    "47 66 99 99 99 99 99 99" + " 99" * 32
)


@dataclass(frozen=True)
class CameraDraw:
    """The camera of one photo.

    Attributes
    ----------
    exposure : float
        The brightest hundredth of the object, relative to white.
    blur : float
        Standard deviation, pixels.
    noise, floor : float
        a and b of the module.
    sharpness, contrast : float
        Strength of the unsharp mask; c of the module.
    quality : float
        Of JPEG, 1 to 100; 0: no file of 8 bits, the light as it is.
    subsampled : float
        1: colours have half the resolution.
    clips : float
        1: light above white is cut.
    """

    exposure: float
    blur: float
    noise: float
    floor: float
    sharpness: float
    contrast: float
    quality: float
    subsampled: float
    clips: float


def draw_camera(rng: np.random.Generator, plain: bool = False) -> CameraDraw:
    """Draw a camera.

    Parameters
    ----------
    rng : numpy.random.Generator
    plain : bool
        Only exposure and a little noise: the ablation without photo chain.

    Returns
    -------
    CameraDraw
    """
    noise = log_uniform(rng, 0.002, 0.05)
    if plain or rng.random() < 0.3:
        clips = 0.0 if plain else float(rng.random() < 0.5)
        exposure = rng.uniform(0.4, 1.2)
        return CameraDraw(exposure, rng.uniform(0, 0.5), noise, 0.2 * noise, 0, 0, 0, 0, clips)
    return CameraDraw(
        exposure=rng.uniform(0.35, 1.6),
        blur=rng.uniform(0, 0.9),
        noise=noise,
        floor=0.3 * noise,
        sharpness=rng.uniform(0, 0.8) * (rng.random() < 0.5),
        contrast=rng.normal(0, 0.35),
        quality=rng.uniform(60, 95),
        subsampled=float(rng.random() < 0.5),
        clips=1.0,
    )


def exposed(light: torch.Tensor, mask: torch.Tensor, exposure: torch.Tensor) -> torch.Tensor:
    """Return the factors that bring pictures to their exposure.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
        Linear.
    mask : (B, 1, H, W) tensor
    exposure : (B,) tensor
        See `CameraDraw`.

    Returns
    -------
    (B, 1, 1, 1) tensor
    """
    bright = (light.amax(1, keepdim=True) * mask).flatten(1)
    rank = (mask.flatten(1).sum(1) * 0.01).long().clamp(min=1, max=bright.shape[1])
    # known without waiting for the device
    most = bright.topk(max(1, bright.shape[1] // 100), dim=1).values.gather(1, rank[:, None] - 1)
    return (exposure[:, None] / most.clamp(min=1e-6))[..., None, None]


def photographed(
    light: torch.Tensor, mask: torch.Tensor, camera: dict[str, torch.Tensor]
) -> torch.Tensor:
    """Take photos and read them back.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
        Linear, exposed; sides are multiples of 16.
    mask : (B, 1, H, W) tensor
        1 on the object: blur does not mix it with the background.
    camera : dict of str to (B,) tensor
        The attributes of `CameraDraw`.

    Returns
    -------
    (B, 3, H, W) tensor
        Linear, as a reader of the file gets it.
    """
    value = {name: part[:, None, None, None] for name, part in camera.items()}
    smooth = _smoothed(torch.cat([light * mask, mask], 1))
    smooth = torch.lerp(light, smooth[:, :3] / smooth[:, 3:].clamp(min=1e-3), mask)
    softness = value["blur"].square() - value["sharpness"]
    image = (light + softness * (smooth - light)).clamp(min=0)
    deviation = value["noise"] * image + value["floor"] * value["exposure"]
    image = (image + deviation * torch.randn_like(image)).clamp(min=0)
    image = torch.where(value["clips"] > 0, image.clamp(max=1), image)
    filed = value["quality"] > 0
    tone = encoded_srgb(image.clamp(max=1))
    tone = (tone + value["contrast"] * tone * (1 - tone) * (2 * tone - 1)).clamp(0, 1)
    tone = through_jpeg(tone, camera["quality"].clamp(min=1), camera["subsampled"])
    return torch.where(filed, decoded_srgb(tone), image)


def _smoothed(layers: torch.Tensor) -> torch.Tensor:
    """Layers (B, C, H, W) filtered by the binomial kernel of 5 pixels, of variance 1."""
    for axis in (2, 3):
        size = layers.shape[axis]
        padded = functional.pad(layers, (2, 2, 0, 0) if axis == 3 else (0, 0, 2, 2))
        parts = [padded.narrow(axis, k, size) for k in range(5)]
        layers = (parts[0] + parts[4] + 4 * (parts[1] + parts[3]) + 6 * parts[2]) / 16
    return layers


def encoded_srgb(light: torch.Tensor) -> torch.Tensor:
    """Apply sRGB's curve.

    Parameters
    ----------
    light : tensor
        In [0, 1].

    Returns
    -------
    tensor
    """
    power = 1.055 * light.clamp(min=1e-6) ** (1 / 2.4) - 0.055
    return torch.where(light <= 0.0031308, 12.92 * light, power)


def decoded_srgb(tone: torch.Tensor) -> torch.Tensor:
    """Undo sRGB's curve.

    Parameters
    ----------
    tone : tensor
        In [0, 1].

    Returns
    -------
    tensor
    """
    return torch.where(tone <= 0.04045, tone / 12.92, ((tone + 0.055) / 1.055) ** 2.4)


def through_jpeg(
    tone: torch.Tensor, quality: torch.Tensor, subsampled: torch.Tensor
) -> torch.Tensor:
    """Quantise pictures as JPEG does.

    Parameters
    ----------
    tone : (B, 3, H, W) tensor
        In [0, 1]; sides are multiples of 16.
    quality : (B,) tensor
        1 to 100.
    subsampled : (B,) tensor
        1: colours have half the resolution.

    Returns
    -------
    (B, 3, H, W) tensor
        In [0, 1], 8 bits.
    """
    colours = torch.einsum("dc,bchw->bdhw", _ycc().to(tone), tone * 255).round()
    luma, chroma = colours[:, :1] - 128, colours[:, 1:]
    coarse = functional.avg_pool2d(chroma, 2)
    scale = torch.where(quality < 50, 5000 / quality, 200 - 2 * quality)[:, None] / 100
    luma = _quantised(luma, _table(_LUMA).to(tone), scale) + 128
    table = _table(_CHROMA).to(tone)
    fine, coarse = _quantised(chroma, table, scale), _quantised(coarse, table, scale)
    coarse = functional.interpolate(coarse, scale_factor=2, mode="bilinear", align_corners=False)
    chroma = torch.where(subsampled[:, None, None, None] > 0, coarse, fine)
    found = torch.einsum(
        "dc,bchw->bdhw", torch.linalg.inv(_ycc()).to(tone), torch.cat([luma, chroma], 1).round()
    )
    return found.round().clamp(0, 255) / 255


def _quantised(layers: torch.Tensor, table: torch.Tensor, scale: torch.Tensor) -> torch.Tensor:
    batch, channels, rows, columns = layers.shape
    cosine = _cosines().to(layers)
    whole = torch.floor(table * scale + 0.5001)  # whole numbers, as files hold them
    step = whole.clamp(min=1, max=255).view(batch, 1, 1, 1, BLOCK, BLOCK)
    # both transforms as long products with one small matrix: fast, unlike one a block
    blocks = layers.reshape(-1, columns // BLOCK, BLOCK) @ cosine.T
    blocks = blocks.view(batch, channels, rows // BLOCK, BLOCK, columns // BLOCK, BLOCK)
    blocks = blocks.permute(0, 1, 2, 4, 5, 3) @ cosine.T
    blocks = (blocks / step.mT).round() * step.mT @ cosine
    blocks = blocks.permute(0, 1, 2, 5, 3, 4).reshape(-1, columns // BLOCK, BLOCK) @ cosine
    return blocks.view(layers.shape)


@cache
def _table(values: str) -> torch.Tensor:
    return torch.tensor([float(one) for one in values.split()])


@cache
def _cosines() -> torch.Tensor:
    """The orthonormal discrete cosine transform (8, 8)."""
    k = torch.arange(BLOCK, dtype=torch.float64)
    found = torch.cos(math.pi / BLOCK * (k + 0.5) * k[:, None]) * math.sqrt(2 / BLOCK)
    found[0] /= math.sqrt(2)
    return found.float()


@cache
def _ycc() -> torch.Tensor:
    """From R, G, B to luma and two colour differences."""
    red, blue = 0.299, 0.114
    green = 1 - red - blue
    return torch.tensor(
        [
            [red, green, blue],
            [-red / 2 / (1 - blue), -green / 2 / (1 - blue), 0.5],
            [0.5, -green / 2 / (1 - red), -blue / 2 / (1 - red)],
        ]
    )
