"""More objects and backgrounds than there are bodies and panoramas, and harder ones.

Problem: a fit sees each of some thousand bodies a hundred times, and overfits them. Bodies of the
colour of what is behind them, thin bodies, and edges of the background that touch a body are what
masks fail at, and are rare where everything is drawn evenly.

Equation: a body is stretched along its own axes by factors s and 1 / s, log s ~ N(0, .15); three
objects and backgrounds in ten have their colour channels exchanged. The light I of half of the
backgrounds becomes m (I / m)^g for their mean m, log g ~ N(0, .25). A body is the one at share
u^1.5 of all bodies in the order of their cover, u uniform. A quarter of the objects get the mean
colour of what they cover, times exp(n), n ~ N(0, .2). One background in three is another one beyond
one or two lines.

Limits: exchanged channels make colours that are rare outside: blue wood, red sky.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from ..world.random_draws import log_uniforms
from ..world.tensor_batch import TensorBatch
from .scenes import PastedObjects

_STRETCH, _POWER, _THIN = 0.15, 0.25, 1.5
_EXCHANGED, _CONTRASTED, _MATCHED, _PARTED, _CORNERS = 0.3, 0.5, 0.25, 0.35, 0.5
_MATCH, _MOST_TINT = 0.2, 3.0
_LEAST = 1e-4


@dataclass(frozen=True)
class ObjectVariation(TensorBatch):
    """How objects get the colour of what they cover.

    Attributes
    ----------
    matched : (N,) bool tensor
        Those that do.
    noise : (N, 3) tensor
        Log of the factors by which they miss it.
    """

    matched: torch.Tensor
    noise: torch.Tensor


@dataclass(frozen=True)
class GroundVariation(TensorBatch):
    """How backgrounds are varied.

    Attributes
    ----------
    channels : (B, 3) int64 tensor
        Those that are shown as red, green and blue.
    power : (B,) tensor
        Of the contrast.
    turn, off, soft : (B, 2) tensor
        Of two lines: angle, distance from the middle with half the side 1, softness in pixels.
    parted : (B, 2) bool tensor
        Which of the lines there are: none, the first, or both.
    gain : (B,) tensor
        Mean light beyond the lines, relative to that before them.
    """

    channels: torch.Tensor
    power: torch.Tensor
    turn: torch.Tensor
    off: torch.Tensor
    soft: torch.Tensor
    parted: torch.Tensor
    gain: torch.Tensor


def varied_objects(
    objects: PastedObjects, rng: np.random.Generator
) -> tuple[PastedObjects, ObjectVariation]:
    """Draw how objects are varied.

    Parameters
    ----------
    objects : PastedObjects
    rng : numpy.random.Generator

    Returns
    -------
    objects : PastedObjects
        Other bodies, stretched, in other colours.
    variation : ObjectVariation
    """
    number = len(objects)
    stretch = np.exp(rng.normal(0, _STRETCH, number))
    noise = rng.normal(0, _MATCH, (number, 1)) + rng.normal(0, _MATCH / 3, (number, 3))
    matched = rng.random(number) < _MATCHED
    objects = replace(
        objects,
        body=objects.body**_THIN,
        stretch=torch.from_numpy(stretch).float(),
        channels=torch.from_numpy(_channels(rng, number)),
    )
    return objects, ObjectVariation.of({"matched": matched, "noise": noise})


def ground_variation(rng: np.random.Generator, number: int) -> GroundVariation:
    """Draw how backgrounds are varied.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int

    Returns
    -------
    GroundVariation
    """
    contrasted = rng.random(number) < _CONTRASTED
    parted = rng.random((number, 2)) < (_PARTED, _CORNERS)
    parted[:, 1] &= parted[:, 0]
    return GroundVariation.of(
        {
            "channels": _channels(rng, number),
            "power": np.exp(contrasted * rng.normal(0, _POWER, number)),
            "turn": rng.uniform(0, 2 * np.pi, (number, 2)),
            "off": rng.normal(0, 0.35, (number, 2)),
            "soft": log_uniforms(rng, 0.5, 5, (number, 2)),
            "parted": parted,
            "gain": np.exp(rng.normal(0, 0.5, number)),
        }
    )


def _channels(rng: np.random.Generator, number: int) -> np.ndarray:
    orders = rng.permuted(np.tile(np.arange(3), (number, 1)), axis=1)
    return np.where(rng.random((number, 1)) < _EXCHANGED, orders, np.arange(3))


def varied_light(light: torch.Tensor, drawn: GroundVariation) -> torch.Tensor:
    """Vary backgrounds.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
        Linear.
    drawn : GroundVariation

    Returns
    -------
    (B, 3, H, W) tensor
    """
    light = light.gather(1, drawn.channels[..., None, None].expand_as(light))
    mean = light.mean((1, 2, 3), keepdim=True).clamp(min=_LEAST)
    light = mean * (light.clamp(min=_LEAST) / mean) ** drawn.power[:, None, None, None]
    return _parted(light, drawn)


def _parted(light: torch.Tensor, drawn: GroundVariation) -> torch.Tensor:
    side = light.shape[-1]
    across = (torch.arange(side, device=light.device) + 0.5) * (2 / side) - 1
    turn, off, soft = (part[..., None, None] for part in (drawn.turn, drawn.off, drawn.soft))
    away = turn.cos() * across + turn.sin() * across[:, None] - off
    half = (0.5 + away * (side / 2) / soft).clamp(0, 1)
    half = torch.where(drawn.parted[..., None, None], half, 1)
    share = half.prod(1) * drawn.parted[:, :1, None]
    other = light.roll(1, 0)
    mean, others = (one.mean((1, 2, 3)).clamp(min=_LEAST) for one in (light, other))
    gain = (drawn.gain * mean / others)[:, None, None, None]
    return torch.lerp(light, gain * other, share[:, None])


def match(
    body: torch.Tensor, cover: torch.Tensor, light: torch.Tensor, drawn: ObjectVariation
) -> torch.Tensor:
    """Give some objects the mean colour of what they cover.

    Parameters
    ----------
    body : (N, 3, H, W) tensor
        Light times cover.
    cover : (N, 1, H, W) tensor
    light : (N, 3, H, W) tensor
        What is behind.
    drawn : ObjectVariation

    Returns
    -------
    (N, 3, H, W) tensor
        Light times cover.
    """
    area = cover.sum((2, 3)).clamp(min=1)
    behind, own = (light * cover).sum((2, 3)) / area, body.sum((2, 3)) / area
    grey = behind.mean(1, keepdim=True) / own.mean(1, keepdim=True).clamp(min=_LEAST)
    tint = behind / (own * grey).clamp(min=_LEAST)
    factor = grey * tint.clamp(1 / _MOST_TINT, _MOST_TINT) * drawn.noise.exp()
    factor = torch.where(drawn.matched[:, None], factor, 1)
    return body * factor[..., None, None]
