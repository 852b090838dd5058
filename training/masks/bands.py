"""Bands of another paint on objects.

Problem: a gourd, a jersey or a fish has bold bands; the mask must contain all of them.

Equation: with the position (u, v) from the object's centre, in units of half its length, along and
across a direction, a point lies in a band if the fraction of f u + c v^2 + p is less than d / 2
from 1/2. There, the three channels of the light are multiplied by three factors.

Limits: bands are bent, but do not follow the surface.
"""

from dataclasses import dataclass

import numpy as np
import torch

from ..world.random_draws import log_uniforms
from ..world.tensor_batch import TensorBatch
from .ingredients import SIDE
from .scenes import PastedObjects

_MOST = 12.0  # factor


@dataclass(frozen=True, eq=False)
class Bands(TensorBatch):
    """Random variables of the bands of a batch's objects.

    Attributes
    ----------
    present : (N,) bool tensor
    factor : (N, 3) tensor
    angle : (N,) tensor
        Of the direction; radians.
    frequency, curve, phase, width : (N,) tensor
        f, c, p and d of the module.
    """

    present: torch.Tensor
    factor: torch.Tensor
    angle: torch.Tensor
    frequency: torch.Tensor
    curve: torch.Tensor
    phase: torch.Tensor
    width: torch.Tensor


def draw_bands(rng: np.random.Generator, number: int, share: float) -> Bands:
    """Draw bands.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int
        Of objects.
    share : float
        Of objects with bands.

    Returns
    -------
    Bands
        On the CPU.
    """
    log_factor = rng.normal(0, 0.9, (number, 1)) + rng.normal(0, 0.4, (number, 3))
    return Bands.of(
        {
            "present": rng.random(number) < share,
            "factor": np.exp(log_factor).clip(1 / _MOST, _MOST),
            "angle": rng.uniform(0, 2 * np.pi, number),
            "frequency": log_uniforms(rng, 0.25, 3, number),
            "curve": rng.normal(0, 0.4, number),
            "phase": rng.random(number),
            "width": rng.uniform(0.2, 0.8, number),
        }
    )


def painted(foreground: torch.Tensor, objects: PastedObjects, drawn: Bands) -> torch.Tensor:
    """Paint bands on objects.

    Parameters
    ----------
    foreground : (N, 3, side, side) tensor
        Light times coverage.
    objects : PastedObjects
    drawn : Bands

    Returns
    -------
    (N, 3, side, side) tensor
    """
    side = foreground.shape[-1]
    across = (torch.arange(side, device=foreground.device) + 0.5) * (2 / side) - 1
    x, y = (across - objects.place[:, k, None] for k in range(2))
    x, y = x[:, None, :], y[:, :, None]
    sine, cosine = (part[:, None, None] for part in (drawn.angle.sin(), drawn.angle.cos()))
    half = (objects.length / SIDE)[:, None, None]
    u, v = (cosine * x + sine * y) / half, (cosine * y - sine * x) / half
    frequency, curve, phase, width = (
        part[:, None, None] for part in (drawn.frequency, drawn.curve, drawn.phase, drawn.width)
    )
    place = (frequency * u + curve * v.square() + phase) % 1
    pixel = frequency * (2 / side) / half
    share = (0.5 + (width / 2 - (place - 0.5).abs()) / pixel).clamp(0, 1)
    share = (share * drawn.present[:, None, None])[:, None]
    return foreground * torch.lerp(torch.ones(()).to(share), drawn.factor[..., None, None], share)
