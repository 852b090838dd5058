"""Patches of photographed surfaces: a smooth body, relief, paint, light, camera.

Equation: the surface z = b + a r is a quadratic b and relief r, where the patch has any. With the
normal n, the light is

    I = albedo sum_k c_k max(0, n . l_k) + c_0 (1 + n . m / 2),

darkened in grooves, with a weak gloss, averaged over 2 x 2 fine pixels and photographed
(`training.world.camera`). The truth is the finest band of the relief's height
(`isc_core.networks.detail_network.band`): no coarser level of a pyramid can hold it. What the
network is told of body and light is what a decomposition knows: the smooth normal, the change of
log shading with the slope, and the share of the fine changes that is relief, all with errors.

Citation: W. Freeman, "The generic viewpoint assumption", Nature 368, 1994, doi:10.1038/368542a0:
one patch may be paint or relief; the mean over what both would look like is the best answer.

Limits: no cast shadows; light does not vary over a patch.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
import torch
from torch.nn import functional

from ..world.camera import CameraDraw, draw_camera, exposed, photographed
from ..world.patterns import make_atlas
from ..world.random_draws import log_uniform
from ..world.tensor_batch import Pool, TensorBatch
from .reliefs import draw_reliefs

FINE = 2  # fine pixels a pixel, each way
_LAMPS = 3
_POOL = 512
_NOISE = 0.2  # of the camera's, which is drawn for photos as small as a network's


@dataclass(frozen=True)
class Patch(TensorBatch):
    """Patches.

    Attributes
    ----------
    photo : (B, 3, H, W) tensor
        Linear, over the mean of an object that is brighter or darker than the patch.
    mask : (B, 1, H, W) tensor
    slope : (B, 2, H, W) tensor
        What is known of the smooth surface: dz/dx, dz/dy, x right, y down.
    gain : (B, 2, H, W) tensor
        What is known of the light: the derivatives of log shading by these slopes.
    belief : (B, 1, 1, 1) tensor
        What is known of the share of relief in the fine changes of log light: -1 paint alone, 1
        relief alone.
    height : (B, 1, H, W) tensor
        Pixels toward the viewer: the finest band of the relief.
    """

    photo: torch.Tensor
    mask: torch.Tensor
    slope: torch.Tensor
    gain: torch.Tensor
    belief: torch.Tensor
    height: torch.Tensor


@dataclass(frozen=True)
class _Light:
    """Light on patches: lamps' directions (B, K, 3) and strengths (B, K, 3), and the ambient's
    strength (B, 3) and slope (B, 3).
    """

    direction: torch.Tensor
    strength: torch.Tensor
    ambient: torch.Tensor
    bias: torch.Tensor

    def __call__(self, normal: torch.Tensor) -> torch.Tensor:
        """Irradiance (B, 3, H, W) of normals (B, 3, H, W)."""
        facing = torch.einsum("bkc,bchw->bkhw", self.direction, normal)
        soft = 0.5 * (facing + torch.sqrt(facing.square() + 0.01))  # a lamp has some size
        lamps = torch.einsum("bkd,bkhw->bdhw", self.strength, soft)
        around = 1 + 0.5 * torch.einsum("bc,bchw->bhw", self.bias, normal)
        return lamps + self.ambient[..., None, None] * around[:, None]


class Patches:
    """Draws batches of patches.

    Parameters
    ----------
    seed : int
        Of the reliefs and patterns.
    batch, side : int
        Patches a batch, and pixels of a side; a multiple of 32.
    count : int
        Reliefs, and patterns, to choose from.
    uses : int, optional
        How often a patch is drawn, on average: drawing one takes as long as learning from it.
    """

    def __init__(self, seed: int, batch: int, side: int, count: int, uses: int = 1) -> None:
        map_side = 3 * FINE * side // 2
        self._count, self._batch, self._side = batch, batch // uses, side
        self._pool = Pool[Patch](_POOL)
        self._reliefs = torch.from_numpy(draw_reliefs(seed, count, map_side))
        self._patterns = torch.from_numpy(make_atlas(seed + 2, count, map_side).maps)

    def __call__(self, rng: np.random.Generator) -> Patch:
        """Draw a batch.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        Patch
        """
        torch.manual_seed(int(rng.integers(2**31)))
        if self._batch == self._count:
            return self._fresh(rng)
        self._pool.exchange(self._fresh(rng))
        return self._pool.picked(torch.from_numpy(rng.random(self._count)).float())

    def _fresh(self, rng: np.random.Generator) -> Patch:
        kind = rng.random(self._batch)
        has_relief, has_print = kind < 0.7, (kind > 0.52) & (kind < 0.95)
        fine = FINE * self._side
        base, base_slope = _bodies(rng, self._batch, fine)
        which = rng.integers(0, len(self._reliefs), self._batch)
        amount = [log_uniform(rng, 0.08, 1.0) * bool(one) for one in has_relief]
        relief = _unit(self._cut(rng, self._reliefs[which], fine)) * _column(amount)
        light, normal = _light(rng, self._batch), _normals(_slopes(base + relief))
        albedo = self._paint(rng, has_print, relief, fine)
        shading = light(normal).clamp(min=1e-4)
        cavity = relief - functional.avg_pool2d(relief, 9, 1, 4)
        depth = [rng.uniform(0, 0.5) * (rng.random() < 0.5) for _ in range(self._batch)]
        shading = shading * torch.exp((_column(depth) * cavity).clamp(-1, 0.1))
        belief = _belief(rng, shading, albedo)
        mask = _masks(rng, self._batch, fine)
        taken = _taken(rng, albedo * shading + _gloss(rng, normal, light), mask, self._side)
        return _patch(rng, taken, base_slope, light, belief, relief)

    def _cut(self, rng: np.random.Generator, maps: torch.Tensor, side: int) -> torch.Tensor:
        """Turned, scaled pieces (B, 1, side, side) of maps (B, S, S)."""
        theta = []
        for _ in maps:
            angle, zoom = rng.uniform(0, 2 * math.pi), log_uniform(rng, 0.6, 2.5)
            stretch, flip = log_uniform(rng, 0.8, 1.25), rng.choice([-1, 1])
            c, s = zoom * math.cos(angle) / 1.5, zoom * math.sin(angle) / 1.5
            shift = rng.uniform(-0.3, 0.3, 2)
            theta.append([[c * flip, -s * stretch, shift[0]], [s * flip, c * stretch, shift[1]]])
        grid = functional.affine_grid(
            torch.tensor(theta, dtype=torch.float32), [len(maps), 1, side, side], False
        )
        return functional.grid_sample(
            maps[:, None].float(), grid, "bicubic", "reflection", align_corners=False
        )

    def _paint(
        self, rng: np.random.Generator, printed: np.ndarray, relief: torch.Tensor, side: int
    ) -> torch.Tensor:
        """Albedo (B, 3, side, side)."""
        which = rng.integers(0, len(self._patterns), self._batch)
        share = (self._cut(rng, self._patterns[which], side) / 255).clamp(0, 1)
        in_grooves = torch.sigmoid(-4 * _unit_range(relief))
        dirty = torch.tensor([rng.random() < 0.15 for _ in printed])[:, None, None, None]
        share = torch.where(dirty, in_grooves, share)
        first = np.exp(rng.uniform(np.log(0.05), np.log(0.9), self._batch))[:, None] * _tint(
            rng, self._batch
        )
        contrast = np.exp(rng.normal(0, 0.8, self._batch))[:, None]
        of_one_hue = (rng.random(self._batch) < 0.5)[:, None]
        second = contrast * np.where(of_one_hue, first, 0.4 * _tint(rng, self._batch))
        second = np.where(printed[:, None], np.clip(second, 0.02, 0.95), first)
        a, b = (torch.from_numpy(np.log(v)).float()[..., None, None] for v in (first, second))
        return torch.exp(a + (b - a) * share)


def band_of(height: torch.Tensor) -> torch.Tensor:
    """Return the finest band; equal to `isc_core.networks.detail_network.band`.

    Parameters
    ----------
    height : (B, 1, H, W) tensor

    Returns
    -------
    (B, 1, H, W) tensor
    """
    coarse = functional.avg_pool2d(height, 2)
    return height - functional.interpolate(
        coarse, scale_factor=2, mode="bilinear", align_corners=False
    )


def _patch(
    rng: np.random.Generator,
    taken: tuple[torch.Tensor, torch.Tensor],
    base_slope: torch.Tensor,
    light: _Light,
    belief: torch.Tensor,
    relief: torch.Tensor,
) -> Patch:
    photo, mask = taken
    slope = functional.avg_pool2d(base_slope, FINE)
    height = functional.avg_pool2d(relief, FINE) / FINE
    known_slope = slope + _smooth_noise(rng, slope, 0.25)
    known = _bent(rng, _gain(light, slope))
    mean = photo.sum((1, 2, 3)) / (3 * mask.sum((1, 2, 3))).clamp(min=1)
    level = torch.from_numpy(np.exp(rng.normal(0, 0.5, len(photo)))).float()
    photo = photo * (level / mean.clamp(min=1e-6))[:, None, None, None]
    return Patch(photo, mask, known_slope, known, belief, band_of(height))


def _column(values: list[float]) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float32)[:, None, None, None]


def _tint(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.asarray(np.exp(rng.normal(0, 0.35, (count, 3)) * rng.choice([0.1, 1, 2], (count, 1))))


def _unit(relief: torch.Tensor) -> torch.Tensor:
    slope = _slopes(relief)
    size = slope.square().sum(1, keepdim=True).mean((2, 3), keepdim=True).sqrt()
    return (relief - relief.mean((2, 3), keepdim=True)) / size.clamp(min=1e-3)


def _unit_range(relief: torch.Tensor) -> torch.Tensor:
    return relief / relief.std((2, 3), keepdim=True).clamp(min=1e-6)


def _bodies(rng: np.random.Generator, count: int, side: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Quadratic heights (B, 1, side, side), fine pixels, and their slopes."""
    x = (torch.arange(side) - (side - 1) / 2).float()
    y, x = torch.meshgrid(x, x, indexing="ij")
    parts = []
    for _ in range(count):
        sine = min(math.sqrt(rng.random()), 0.96)
        slope, angle = sine / math.sqrt(1 - sine**2), rng.uniform(0, 2 * math.pi)
        bend = rng.normal(0, log_uniform(rng, 0.0005, 0.008), 3) / FINE
        parts.append([slope * math.cos(angle), slope * math.sin(angle), *bend])
    p, q, a, b, c = (
        torch.tensor(v, dtype=torch.float32)[:, None, None] for v in zip(*parts, strict=True)
    )
    height = p * x + q * y + (a * x * x + b * y * y) / 2 + c * x * y
    slope = torch.stack([p + a * x + c * y, q + b * y + c * x], 1)
    return height[:, None], slope


def _slopes(height: torch.Tensor) -> torch.Tensor:
    """dz/dx, dz/dy (B, 2, H, W) by central differences."""
    padded = functional.pad(height, (1, 1, 1, 1), mode="replicate")
    right = (padded[:, :, 1:-1, 2:] - padded[:, :, 1:-1, :-2]) / 2
    down = (padded[:, :, 2:, 1:-1] - padded[:, :, :-2, 1:-1]) / 2
    return torch.cat([right, down], 1)


def _normals(slope: torch.Tensor) -> torch.Tensor:
    length = torch.sqrt(1 + slope.square().sum(1, keepdim=True))
    return torch.cat([-slope, torch.ones_like(length)], 1) / length


def _light(rng: np.random.Generator, count: int) -> _Light:
    direction = rng.standard_normal((count, _LAMPS, 3))
    direction[..., 2] = np.abs(direction[..., 2]) * rng.uniform(0, 1.5, (count, _LAMPS)) - 0.1
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    strength = np.exp(rng.normal(0, 1, (count, _LAMPS, 1)) + rng.normal(0, 0.1, (count, _LAMPS, 3)))
    strength *= (np.arange(_LAMPS) < rng.integers(1, _LAMPS + 1, (count, 1)))[..., None]
    ambient = np.exp(
        rng.uniform(np.log(0.05), np.log(1.5), (count, 1)) + rng.normal(0, 0.1, (count, 3))
    )
    bias = rng.standard_normal((count, 3))
    bias *= rng.uniform(0, 1, (count, 1)) / np.linalg.norm(bias, axis=1, keepdims=True)
    return _Light(*(torch.from_numpy(v).float() for v in (direction, strength, ambient, bias)))


def _gain(light: _Light, slope: torch.Tensor, step: float = 0.02) -> torch.Tensor:
    """Derivatives (B, 2, H, W) of the mean log shading by the slopes, which are smooth."""
    size, slope, found = slope.shape[2:], functional.avg_pool2d(slope, 8), []
    for axis in range(2):
        move = torch.zeros(2)[:, None, None]
        move[axis] = step
        ahead, behind = (
            torch.log(light(_normals(slope + sign * move)).mean(1).clamp(min=1e-4))
            for sign in (1, -1)
        )
        found.append((ahead - behind) / (2 * step))
    return functional.interpolate(torch.stack(found, 1), size, mode="bilinear", align_corners=False)


def _bent(rng: np.random.Generator, gain: torch.Tensor) -> torch.Tensor:
    """`gain` as well as an estimated light knows it: turned, too strong or weak, biased."""
    count = len(gain)
    spread = rng.choice([0.1, 0.25, 0.5], count)
    angle = torch.from_numpy(rng.normal(0, spread)).float()[:, None, None]
    size = torch.from_numpy(np.exp(rng.normal(0, 0.4, count))).float()[:, None, None]
    c, s = size * torch.cos(angle), size * torch.sin(angle)
    turned = torch.stack([c * gain[:, 0] - s * gain[:, 1], s * gain[:, 0] + c * gain[:, 1]], 1)
    bias = torch.from_numpy(rng.normal(0, 0.12, (count, 2))).float()[..., None, None]
    return turned + bias


def _belief(rng: np.random.Generator, shading: torch.Tensor, albedo: torch.Tensor) -> torch.Tensor:
    """The share of relief in the fine changes of log light, as well as an object tells it."""
    of_relief, of_paint = (
        band_of(functional.avg_pool2d(torch.log(part).mean(1, keepdim=True), FINE))
        .square()
        .mean((1, 2, 3), keepdim=True)
        for part in (shading, albedo)
    )
    share = of_relief / (of_relief + of_paint).clamp(min=1e-12)
    error = _column([rng.normal(0, rng.choice([0.1, 0.3, 1.0])) for _ in range(len(share))])
    return (2 * share - 1 + error).clamp(-1, 1)


def _smooth_noise(rng: np.random.Generator, like: torch.Tensor, size: float) -> torch.Tensor:
    coarse = torch.from_numpy(rng.normal(0, size, (len(like), 2, 3, 3))).float()
    scale = 1 + like.square().sum(1, keepdim=True).mean((2, 3), keepdim=True)
    return scale * functional.interpolate(
        coarse, like.shape[2:], mode="bilinear", align_corners=True
    )


def _gloss(rng: np.random.Generator, normal: torch.Tensor, light: _Light) -> torch.Tensor:
    """What a separation leaves of highlights (B, 1, H, W); none on most patches."""
    count = len(normal)
    half = functional.normalize(light.direction[:, 0] + torch.tensor([0.0, 0.0, 1.0]), dim=1)
    facing = torch.einsum("bc,bchw->bhw", half, normal).clamp(min=0)[:, None]
    power = _column([log_uniform(rng, 5, 80) for _ in range(count)])
    amount = _column([log_uniform(rng, 0.02, 0.3) * (rng.random() < 0.25) for _ in range(count)])
    return amount * light.strength[:, :1, :1, None] * facing**power


def _masks(rng: np.random.Generator, count: int, fine: int) -> torch.Tensor:
    """Masks (B, 1, fine, fine); some patches lie on the outline."""
    x = torch.linspace(-1, 1, fine)
    y, x = torch.meshgrid(x, x, indexing="ij")
    rows = []
    for _ in range(count):
        angle, bend = rng.uniform(0, 2 * math.pi), rng.normal(0, 0.4)
        along, across = (
            x * math.cos(angle) + y * math.sin(angle),
            y * math.cos(angle) - x * math.sin(angle),
        )
        offset = rng.uniform(-0.3, 1) if rng.random() < 0.3 else 3.0
        rows.append(along + bend * across.square() < offset)
    return torch.stack(rows)[:, None].float()


def _taken(
    rng: np.random.Generator, light: torch.Tensor, mask: torch.Tensor, side: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Photos of patches, and their masks: half of the files are finer than the patch."""
    if rng.random() < 0.5:
        light, mask = _pooled(light, mask)
    draws = [draw_camera(rng) for _ in light]
    camera = {
        one.name: torch.tensor([getattr(draw, one.name) for draw in draws], dtype=torch.float32)
        for one in fields(CameraDraw)
    }
    camera["noise"], camera["floor"] = _NOISE * camera["noise"], _NOISE * camera["floor"]
    photo = photographed(light * exposed(light, mask, camera["exposure"]), mask, camera) * mask
    return (photo, mask) if mask.shape[-1] == side else _pooled(photo, mask)


def _pooled(light: torch.Tensor, mask: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    share = functional.avg_pool2d(mask, FINE)
    light = functional.avg_pool2d(light * mask, FINE) / share.clamp(min=1e-6)
    mask = (share >= 0.5).float()
    return light * mask, mask
