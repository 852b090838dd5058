"""Batches of lit views from recipes: the numbers of `training.world.recipes` become tensors.

Problem: drawing is cheap and particular, lighting is expensive and uniform. Worker processes draw;
the device of the fit paints and lights whole batches.

Equation: see `training.world.recipes` (paint) and `training.world.lighting` (light).

Limits: all surroundings of the bank have as many rows, so that they lie in one tensor. A table is
infinitely far below a body, without its shadow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch.nn import functional

from isc_core.shading.environment_map import mean_radiance

from .environments import smoothed_levels
from .lighting import Lights, LitViews, Material, light_coefficients, light_views
from .patterns import Atlas
from .recipes import LAYERS, Recipe
from .tensor_batch import TensorBatch
from .view_batches import ViewBatch

ALPHAS = (0.06, 0.12, 0.2, 0.33, 0.55)  # roughness of the bank's levels
_WIDE = 0.16  # the level that serves the stored directions: as wide as they are apart, 20 degrees
_MOST = 0.95
_HORIZON = 0.5  # of a level's roughness: how far a table's edge is smoothed


@dataclass(frozen=True, eq=False)
class Bank(TensorBatch):
    """Surroundings and patterns, ready to be looked up.

    Attributes
    ----------
    maps : (N, levels, 3, rows, 2 rows) tensor
        Radiance of mean 1, smoothed for `ALPHAS` and, last, for the stored directions.
    patterns : (M, 1, side, side) tensor
        Grey values in [0, 1].
    """

    maps: torch.Tensor
    patterns: torch.Tensor


def bank_of(environments: Sequence[np.ndarray], atlas: Atlas) -> Bank:
    """Smooth surroundings and collect patterns.

    Parameters
    ----------
    environments : sequence of (rows, 2 rows, 3) ndarray
        Not black.
    atlas : Atlas

    Returns
    -------
    Bank
        On the CPU.
    """
    widths = (*ALPHAS, _WIDE)
    unit = (one / max(float(mean_radiance(one).mean()), 1e-9) for one in environments)
    levels = [np.asarray(smoothed_levels(one, widths), np.float32) for one in unit]
    maps = torch.from_numpy(np.stack(levels)).permute(0, 1, 4, 2, 3).contiguous()
    return Bank(maps, torch.from_numpy(atlas.maps[:, None]).float() / 255)


def stacked(recipes: Sequence[Recipe]) -> dict[str, torch.Tensor]:
    """Collect the numbers of recipes.

    Parameters
    ----------
    recipes : sequence of Recipe

    Returns
    -------
    dict of str to tensor
        By the names of `Recipe`'s attributes; floats are float32.
    """
    found = {}
    for name in Recipe.__dataclass_fields__:
        values = torch.from_numpy(np.stack([np.asarray(getattr(one, name)) for one in recipes]))
        found[name] = values.float() if values.is_floating_point() else values.long()
    return found


def lit_pictures(views: ViewBatch, recipes: dict[str, torch.Tensor], bank: Bank) -> LitViews:
    """Paint and light views.

    Parameters
    ----------
    views : ViewBatch
    recipes : dict of str to tensor
        See `stacked`.
    bank : Bank
        All on one device.

    Returns
    -------
    LitViews
    """
    material, lights = material_of(views, recipes, bank), lights_of(recipes, bank)
    if bool((lights.given > 0).any()):
        alone = replace(lights, power=torch.zeros_like(lights.power), given=0 * lights.given)
        shape = light_coefficients(views, alone)
        gain = recipes["harmonic_gain"][:, None, None]
        harmonics = gain * shape + recipes["harmonic_noise"]
        lights = replace(lights, harmonics=harmonics)
    return light_views(views, material, lights)


def material_of(views: ViewBatch, recipes: dict[str, torch.Tensor], bank: Bank) -> Material:
    """Paint views.

    Parameters
    ----------
    views : ViewBatch
    recipes : dict of str to tensor
    bank : Bank

    Returns
    -------
    Material
    """
    pixels = views.position.shape[1]
    albedo = recipes["base"][:, None].expand(-1, pixels, -1)
    first = torch.zeros_like(views.thickness)
    for k in range(LAYERS):
        strength = recipes["strengths"][:, k, None]
        if k and not bool((strength > 0).any()):
            continue
        grey = _grey(views, recipes, bank, k)
        first = grey if k == 0 else first
        share = (strength * grey).unsqueeze(-1)
        albedo = albedo + share * (recipes["colours"][:, k, None] - albedo)
    alpha = recipes["alpha"][:, None] * torch.exp(recipes["alpha_range"][:, None] * (first - 0.5))
    return Material(
        albedo.clamp(0, _MOST),
        alpha.clamp(0.03, 0.8),
        recipes["front"][:, None].expand(-1, pixels, -1) * 1.0,
        recipes["coat"],
        recipes["sigma"],
        (recipes["kind"] == 2).float(),
    ).without_diffuse(recipes["kind"] == 1)


def _grey(
    views: ViewBatch, recipes: dict[str, torch.Tensor], bank: Bank, layer: int
) -> torch.Tensor:
    """Grey values (B, P) of one layer's map on the bodies."""
    place = views.position @ recipes["frames"][:, layer].mT
    turns = torch.atan2(place[..., 0], place[..., 2]) / (2 * math.pi)
    wound = turns * recipes["frames"][:, layer, 0].norm(dim=-1)[:, None].round().clamp(min=1)
    around = recipes["around"][:, layer, None]
    u = around * wound + (1 - around) * place[..., 0]
    at = torch.stack([u, place[..., 1]], dim=-1) + recipes["shifts"][:, layer, None]
    outside = ((at < 0) | (at > 1)).any(-1) & (recipes["once"][:, layer, None] > 0)
    grid = torch.remainder(at, 1) * 2 - 1
    grey = functional.grid_sample(
        bank.patterns[recipes["maps"][:, layer]],
        grid[:, :, None],
        padding_mode="border",
        align_corners=False,
    )[:, 0, :, 0]
    return grey * ~outside


def lights_of(recipes: dict[str, torch.Tensor], bank: Bank) -> Lights:
    """Collect the light of recipes.

    Parameters
    ----------
    recipes : dict of str to tensor
    bank : Bank

    Returns
    -------
    Lights
        Its harmonics are 0.
    """
    ambient = recipes["ambient"][:, None, :, None, None]
    surroundings = bank.maps[recipes["environment"]].float() * ambient
    return Lights(
        _with_table(surroundings, recipes),
        torch.tensor((*ALPHAS, _WIDE), device=ambient.device),
        recipes["turn"],
        recipes["lamp"],
        recipes["power"],
        recipes["distance"],
        recipes["radius"],
        torch.zeros_like(recipes["harmonic_noise"]),
        recipes["given"],
        recipes["bounce"],
    )


def _with_table(surroundings: torch.Tensor, recipes: dict[str, torch.Tensor]) -> torch.Tensor:
    """Surroundings (B, levels, 3, rows, 2 rows) whose lower half is a table, where one stands.

    The table is matt, of one colour, and lit by the upper half and the lamps.
    """
    rows = surroundings.shape[-2]
    angle = (torch.arange(rows, device=surroundings.device) + 0.5) * (math.pi / rows)
    falling = torch.cos(angle).clamp(min=0) * torch.sin(angle) * (math.pi / rows**2)
    lit = (surroundings[:, 0].sum(-1) * falling).sum(-1) + recipes["table_light"]
    radiance = (recipes["table"] * lit)[:, None, :, None, None]
    widths = torch.tensor((*ALPHAS, _WIDE), device=surroundings.device)[:, None]
    share = torch.sigmoid(-torch.cos(angle) / (_HORIZON * widths))[:, None, :, None]
    share = share * recipes["standing"][:, None, None, None, None]
    return torch.lerp(surroundings, radiance.expand_as(surroundings), share)
