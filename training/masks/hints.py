"""Simulated hints of users: points and boxes, for a batch.

Problem: the network learns to use hints, and each photo needs other ones.

Equation: a random pixel of a set S is the first at which the running count of S exceeds u |S|, for
u uniform in [0, 1).

Limits: points are uniform over the object; people point at its middle.
"""

from dataclasses import dataclass

import numpy as np
import torch

from isc_core.networks.mask_network import POINT_RADIUS

from ..world.tensor_batch import TensorBatch

_MAX_POINTS = 3  # of one kind
_BACKGROUND, _SAME = 0.06, 0.6  # shares of hints on the background; on the target without hints
_MIN_PIXELS = 40  # visible pixels of an object that hints may select


@dataclass(frozen=True, eq=False)
class HintDraws(TensorBatch):
    """Random variables of the hints of a batch.

    Attributes
    ----------
    given : (B,) bool tensor
        The photo has hints.
    background, same : (B,) bool tensor
        Hints lie on the background; on the target without hints.
    preferred : (B, MAX_OBJECTS) tensor
        Otherwise, hints lie on the visible object with the largest of these numbers.
    points : (B, 2, _MAX_POINTS) tensor
        u of the module, on the object and on the background; above 1: no point.
    box : (B,) bool tensor
        Whether there is a box.
    margins : (B, 4) tensor
        Distances of the box from the object above, below, left and right, of the object's sides.
    """

    given: torch.Tensor
    background: torch.Tensor
    same: torch.Tensor
    preferred: torch.Tensor
    points: torch.Tensor
    box: torch.Tensor
    margins: torch.Tensor


def draw_hints(rng: np.random.Generator, number: int, share: float, most: int) -> HintDraws:
    """Draw hints.

    Parameters
    ----------
    rng : numpy.random.Generator
    number : int
        Of photos.
    share : float
        Of photos with hints.
    most : int
        Maximum number of objects in a photo.

    Returns
    -------
    HintDraws
        On the CPU.
    """
    kind = rng.random(number)
    counts = rng.integers(1, _MAX_POINTS + 1, (number, 2, 1))
    counts[:, 0, 0] *= kind < 0.7
    counts[:, 1, 0] *= rng.random(number) < 0.35
    points = rng.random((number, 2, _MAX_POINTS)) + 2 * (np.arange(_MAX_POINTS) >= counts)
    return HintDraws.of(
        {
            "given": rng.random(number) < share,
            "background": rng.random(number) < _BACKGROUND,
            "same": rng.random(number) < _SAME,
            "preferred": rng.random((number, most)),
            "points": points,
            "box": kind > 0.5,
            "margins": rng.normal(0.03, 0.04, (number, 4)).clip(-0.06, 0.2),
        }
    )


def hinted(
    covers: torch.Tensor, target: torch.Tensor, single: torch.Tensor, draws: HintDraws
) -> torch.Tensor:
    """Choose the objects that hints select.

    Parameters
    ----------
    covers : (B, T, H, W) tensor
        Visible part of each object.
    target : (B, T) bool tensor
        Targets without hints.
    single : (B,) bool tensor
        The targets of the photo are the parts of one object.
    draws : HintDraws

    Returns
    -------
    (B, T) bool tensor
        At most one object per photo, with all of its parts; none if the hints lie on the
        background.
    """
    seen = (covers > 0.5).sum((2, 3)) > _MIN_PIXELS
    alone = target & single[:, None]
    preferred = draws.preferred[:, : covers.shape[1]] + 2 * (alone & draws.same[:, None])
    preferred = torch.where(seen, preferred, -1)
    best = preferred == preferred.amax(1, keepdim=True)
    best = best & seen
    best = best | (alone & (best & alone).any(1, keepdim=True))
    return best & ~draws.background[:, None]


def hint_maps(truth: torch.Tensor, inside: torch.Tensor, draws: HintDraws) -> torch.Tensor:
    """Draw the hint channels of the network.

    Parameters
    ----------
    truth : (B, H, W) bool tensor
        The target; if empty, points lie on the background.
    inside : (B, H, W) bool tensor
        The frame.
    draws : HintDraws

    Returns
    -------
    (B, 3, H, W) tensor
        Points on the object, points on the background, the box; 0 without hints.
    """
    some = truth.any(2).any(1)[:, None, None]
    known, others = torch.where(some, truth, inside), inside & ~truth
    maps = [_discs(where, draws.points[:, k]) for k, where in enumerate((known, others))]
    box = _box(truth, draws.margins) & inside & some & draws.box[:, None, None]
    return torch.stack([*maps, box], 1).float() * draws.given[:, None, None, None]


def _discs(where: torch.Tensor, uniform: torch.Tensor) -> torch.Tensor:
    """Discs (B, H, W) around random pixels of sets, chosen by u (B, K) of the module."""
    counted = where.flatten(1).cumsum(1)
    total = counted[:, -1:]
    at = torch.searchsorted(counted, (uniform * total).long(), right=True)
    width = where.shape[2]
    row, column = (part[..., None] for part in (at // width, at % width))
    off = [torch.arange(n, device=where.device) for n in where.shape[1:]]
    tall, wide = (off[0] - row).square(), (off[1] - column).square()
    disc = tall[..., :, None] + wide[..., None, :] <= POINT_RADIUS**2
    return (disc & ((uniform < 1) & (total > 0))[..., None, None]).any(1)


def _box(truth: torch.Tensor, margins: torch.Tensor) -> torch.Tensor:
    """Filled boxes (B, H, W) around sets."""
    sides = []
    for axis, off in ((2, margins[:, :2]), (1, margins[:, 2:])):
        line = truth.any(axis)
        place = torch.arange(line.shape[1], device=truth.device)
        first = torch.where(line, place, line.shape[1]).amin(1, keepdim=True)
        last = torch.where(line, place + 1, 0).amax(1, keepdim=True)
        low, high = (first - off[:, :1] * (last - first)), (last + off[:, 1:] * (last - first))
        sides.append((place >= low.round()) & (place < high.round()))
    return sides[0][:, :, None] & sides[1][:, None, :]
