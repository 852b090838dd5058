"""Data augmentation: varied cut-outs and backgrounds, and more difficult ones.

Problem: a training run uses each of a few thousand cut-outs a hundred times, and overfits. Masks
fail on objects that have the colour of their background, on thin objects, and where edges of the
background meet the object. All three are rare if everything is drawn uniformly.

Equation: a cut-out is stretched along its axes by factors s and 1 / s, log s ~ N(0, .15). Three
objects and backgrounds in ten have permuted colour channels. The light I of half of the backgrounds
becomes m (I / m)^g for their mean m, log g ~ N(0, .25). Of the cut-outs in the order of their
coverage, the one at the fraction u^1.5 is chosen, u uniform. A quarter of the objects get the mean
colour of what they cover, times exp(n), n ~ N(0, .2). A third of the backgrounds continue as
another one beyond one or two lines.

Limits: permuted channels make colours that are rare in reality: blue wood, red sky.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from ..world.random_draws import log_uniforms
from ..world.tensor_batch import TensorBatch
from .scenes import PastedObjects

_STRETCH, _POWER, _MATCH = 0.15, 0.25, 0.2  # standard deviations of log s, log g and n
_THIN = 1.5  # exponent of u
_PERMUTED, _CONTRASTED, _MATCHED = 0.3, 0.5, 0.25  # shares
_SPLIT, _CORNERS = 0.35, 0.5  # shares of backgrounds that are split; of those, by two lines
_MAX_TINT = 3.0  # factor of a channel, relative to grey
_EPSILON = 1e-4


@dataclass(frozen=True, eq=False)
class ObjectVariation(TensorBatch):
    """Random variables of `matched_colours`.

    Attributes
    ----------
    matched : (N,) bool tensor
        Whether the object gets the colour of what it covers.
    noise : (N, 3) tensor
        n of the module.
    """

    matched: torch.Tensor
    noise: torch.Tensor


@dataclass(frozen=True, eq=False)
class BackgroundVariation(TensorBatch):
    """Random variables of `varied_backgrounds`.

    Attributes
    ----------
    channels : (B, 3) int64 tensor
        Channels that become red, green and blue.
    power : (B,) tensor
        g of the module.
    angle, distance, softness : (B, 2) tensor
        Of two lines: radians; distance from the centre in units of half the side; pixels.
    present : (B, 2) bool tensor
        Whether there is a line: none, the first, or both.
    gain : (B,) tensor
        Mean light beyond the lines, relative to that before them.
    """

    channels: torch.Tensor
    power: torch.Tensor
    angle: torch.Tensor
    distance: torch.Tensor
    softness: torch.Tensor
    present: torch.Tensor
    gain: torch.Tensor


def varied_objects(
    objects: PastedObjects, rng: np.random.Generator
) -> tuple[PastedObjects, ObjectVariation]:
    """Vary objects, and draw the variation of their colours.

    Parameters
    ----------
    objects : PastedObjects
    rng : numpy.random.Generator

    Returns
    -------
    objects : PastedObjects
        Other cut-outs, stretched, with permuted channels.
    variation : ObjectVariation
    """
    number = len(objects)
    stretch = np.exp(rng.normal(0, _STRETCH, number))
    noise = rng.normal(0, _MATCH, (number, 1)) + rng.normal(0, _MATCH / 3, (number, 3))
    matched = rng.random(number) < _MATCHED
    objects = replace(
        objects,
        cutout=objects.cutout**_THIN,
        stretch=torch.from_numpy(stretch).float(),
        channels=torch.from_numpy(_permutations(rng, number)),
    )
    return objects, ObjectVariation.of({"matched": matched, "noise": noise})


def draw_background_variation(rng: np.random.Generator, number: int) -> BackgroundVariation:
    """Draw the variation of backgrounds.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int

    Returns
    -------
    BackgroundVariation
    """
    contrasted = rng.random(number) < _CONTRASTED
    present = rng.random((number, 2)) < (_SPLIT, _CORNERS)
    present[:, 1] &= present[:, 0]
    return BackgroundVariation.of(
        {
            "channels": _permutations(rng, number),
            "power": np.exp(contrasted * rng.normal(0, _POWER, number)),
            "angle": rng.uniform(0, 2 * np.pi, (number, 2)),
            "distance": rng.normal(0, 0.35, (number, 2)),
            "softness": log_uniforms(rng, 0.5, 5, (number, 2)),
            "present": present,
            "gain": np.exp(rng.normal(0, 0.5, number)),
        }
    )


def _permutations(rng: np.random.Generator, number: int) -> np.ndarray:
    """Orders (N, 3) of the channels; most are the identity."""
    orders = rng.permuted(np.tile(np.arange(3), (number, 1)), axis=1)
    return np.where(rng.random((number, 1)) < _PERMUTED, orders, np.arange(3))


def varied_backgrounds(light: torch.Tensor, drawn: BackgroundVariation) -> torch.Tensor:
    """Vary backgrounds.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
        Linear.
    drawn : BackgroundVariation

    Returns
    -------
    (B, 3, H, W) tensor
    """
    light = light.gather(1, drawn.channels[..., None, None].expand_as(light))
    mean = light.mean((1, 2, 3), keepdim=True).clamp(min=_EPSILON)
    light = mean * (light.clamp(min=_EPSILON) / mean) ** drawn.power[:, None, None, None]
    return _split(light, drawn)


def _split(light: torch.Tensor, drawn: BackgroundVariation) -> torch.Tensor:
    side = light.shape[-1]
    across = (torch.arange(side, device=light.device) + 0.5) * (2 / side) - 1
    angle, distance, softness = (
        part[..., None, None] for part in (drawn.angle, drawn.distance, drawn.softness)
    )
    away = angle.cos() * across + angle.sin() * across[:, None] - distance
    half = (0.5 + away * (side / 2) / softness).clamp(0, 1)
    half = torch.where(drawn.present[..., None, None], half, 1)
    share = half.prod(1) * drawn.present[:, :1, None]
    other = light.roll(1, 0)
    mean, others = (one.mean((1, 2, 3)).clamp(min=_EPSILON) for one in (light, other))
    gain = (drawn.gain * mean / others)[:, None, None, None]
    return torch.lerp(light, gain * other, share[:, None])


def matched_colours(
    foreground: torch.Tensor, cover: torch.Tensor, light: torch.Tensor, drawn: ObjectVariation
) -> torch.Tensor:
    """Give some objects the mean colour of what they cover.

    Parameters
    ----------
    foreground : (N, 3, H, W) tensor
        Light times coverage.
    cover : (N, 1, H, W) tensor
    light : (N, 3, H, W) tensor
        Of what they cover.
    drawn : ObjectVariation

    Returns
    -------
    (N, 3, H, W) tensor
        Light times coverage.
    """
    area = cover.sum((2, 3)).clamp(min=1)
    behind, own = (light * cover).sum((2, 3)) / area, foreground.sum((2, 3)) / area
    grey = behind.mean(1, keepdim=True) / own.mean(1, keepdim=True).clamp(min=_EPSILON)
    tint = behind / (own * grey).clamp(min=_EPSILON)
    factor = grey * tint.clamp(1 / _MAX_TINT, _MAX_TINT) * drawn.noise.exp()
    factor = torch.where(drawn.matched[:, None], factor, 1)
    return foreground * factor[..., None, None]
