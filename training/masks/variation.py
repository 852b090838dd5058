"""More things and backgrounds than there are bodies and panoramas.

Problem: a fit sees each of some thousand bodies and backgrounds a hundred times, and learns them by
heart.

Equation: a body is stretched along its own axes by factors s and 1 / s, log s ~ N(0, .15); three
things and backgrounds in ten have their colour channels exchanged. The light I of half of the
backgrounds becomes m (I / m)^g for their mean m, log g ~ N(0, .25).

Limits: exchanged channels make colours that are rare outside: blue wood, red sky.
"""

from dataclasses import replace

import numpy as np
import torch

from .scenes import Scene, Thing

_STRETCH, _POWER = 0.15, 0.25
_EXCHANGED, _CONTRASTED = 0.3, 0.5
_LEAST = 1e-4


def varied_scene(scene: Scene, rng: np.random.Generator) -> Scene:
    """Vary the things of a scene.

    Parameters
    ----------
    scene : Scene
    rng : numpy.random.Generator

    Returns
    -------
    Scene
    """
    return replace(scene, things=[_varied(one, rng) for one in scene.things])


def _varied(thing: Thing, rng: np.random.Generator) -> Thing:
    stretch = float(np.exp(rng.normal(0, _STRETCH)))
    return replace(thing, stretch=(stretch, 1 / stretch), channels=_channels(rng))


def _channels(rng: np.random.Generator) -> tuple[int, ...]:
    if rng.random() >= _EXCHANGED:
        return (0, 1, 2)
    return tuple(int(k) for k in rng.permutation(3))


def varied_light(light: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Vary backgrounds.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
        Linear.
    rng : numpy.random.Generator

    Returns
    -------
    (B, 3, H, W) tensor
    """
    channels = torch.tensor([_channels(rng) for _ in light])
    light = light[torch.arange(len(light))[:, None], channels]
    rows = torch.from_numpy(np.flatnonzero(rng.random(len(light)) < _CONTRASTED))
    power = torch.from_numpy(np.exp(rng.normal(0, _POWER, (len(rows), 1, 1, 1)))).float()
    some = light[rows]
    mean = some.mean((1, 2, 3), keepdim=True).clamp(min=_LEAST)
    light[rows] = mean * (some.clamp(min=_LEAST) / mean) ** power
    return light
