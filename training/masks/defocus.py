"""Defocused backgrounds.

Problem: a lens of large aperture shows what lies behind the object as a blur, lamps as discs.

Equation: the light of each point spreads evenly over a disc of radius r. Radii grow from 0 near the
lower border to r further up, where the ground is more distant, or are r everywhere. Highlights are
brighter than the panoramas' 1: light I becomes I (1 + s (I / max I)^3).

Citation: M. Potmesil, I. Chakravarty, "A lens and aperture camera model for synthetic image
generation", SIGGRAPH 1981, doi:10.1145/800224.806818.

Limits: between the radii 0, r / 2 and r, blurred photos are blended; the object itself is sharp.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from ..world.random_draws import log_uniforms
from ..world.tensor_batch import TensorBatch

_RADII = (0.012, 0.1)  # of the frame's side
_EVERYWHERE = 0.5  # share of photos with one radius
_LAMPS, _STRONGEST = 0.5, 12.0  # share of photos with brighter highlights; largest s


@dataclass(frozen=True, eq=False)
class Defocus(TensorBatch):
    """Random variables of the blur of a batch.

    Attributes
    ----------
    radius : (B,) tensor
        r of the module, of the side of the frame; 0: not blurred.
    edge, softness : (B,) tensor
        Row at which the radius is r / 2, and height over which it grows; -1 to 1 is the frame.
    highlights : (B,) tensor
        s of the module.
    """

    radius: torch.Tensor
    edge: torch.Tensor
    softness: torch.Tensor
    highlights: torch.Tensor


def draw_defocus(rng: np.random.Generator, number: int, share: float) -> Defocus:
    """Draw the blur of a batch.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int
        Of photos.
    share : float
        Of photos that are blurred.

    Returns
    -------
    Defocus
        On the CPU.
    """
    everywhere, lamps = rng.random(number) < _EVERYWHERE, rng.random(number) < _LAMPS
    return Defocus.of(
        {
            "radius": log_uniforms(rng, *_RADII, number) * (rng.random(number) < share),
            "edge": np.where(everywhere, 10.0, rng.uniform(-0.3, 1.2, number)),
            "softness": log_uniforms(rng, 0.3, 2, number),
            "highlights": lamps * rng.uniform(0, _STRONGEST, number),
        }
    )


def defocused(light: torch.Tensor, drawn: Defocus) -> torch.Tensor:
    """Blur photos.

    Parameters
    ----------
    light : (B, 3, side, side) tensor
        Linear.
    drawn : Defocus

    Returns
    -------
    (B, 3, side, side) tensor
        With the same mean light.
    """
    side = light.shape[-1]
    peak = light.amax((1, 2, 3), keepdim=True).clamp(min=1e-6)
    bright = light * (1 + drawn.highlights[:, None, None, None] * (light / peak) ** 3)
    half, full = (_spread(bright, drawn.radius * (side * share)) for share in (0.5, 1.0))
    down = (torch.arange(side, device=light.device) + 0.5) * (2 / side) - 1
    amount = 0.5 + (drawn.edge[:, None] - down) / drawn.softness[:, None]
    amount = 2 * amount.clamp(0, 1)[:, None, :, None]
    found = torch.lerp(torch.lerp(bright, half, amount.clamp(max=1)), full, (amount - 1).clamp(0))
    mean = [one.mean((1, 2, 3), keepdim=True).clamp(min=1e-6) for one in (light, found)]
    return found * (mean[0] / mean[1])


def _spread(light: torch.Tensor, radius: torch.Tensor) -> torch.Tensor:
    """Spread light (B, C, side, side) over discs whose radii (B,) are in pixels."""
    side = light.shape[-1]
    border = int(_RADII[1] * side) + 2
    padded = functional.pad(light, (border,) * 4, mode="replicate")
    size = side + 2 * border
    away = torch.fft.fftfreq(size, 1 / size).to(light.device)
    distance = torch.hypot(away[:, None], away)
    disc = (radius[:, None, None] + 0.5 - distance).clamp(0, 1)
    disc = torch.fft.rfft2(disc / disc.sum((1, 2), keepdim=True))[:, None]
    found = torch.fft.irfft2(torch.fft.rfft2(padded) * disc, s=(size, size))
    return found[..., border:-border, border:-border].clamp(min=0)
