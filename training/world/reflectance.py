"""How much of uniform surroundings a GGX surface reflects toward the camera.

Problem: mirrored surroundings, smoothed beforehand, need a factor: what the whole lobe reflects.
Fresnel's factor at the surface's own normal is several times too large at grazing angles of rough
surfaces, whose facets hide each other and mostly lean toward the camera.

Equation: with the facets of `isc_core.shading.brdf.ggx`,

    E(f) = integral of D G F / (4 n.v) dl = f (a - b) + b,    F = f + (1 - f) (1 - v.h)^5,

a and b the integrals with 1 and (1 - v.h)^5 in place of F, functions of roughness and n.v alone:
a table, filled once by sums over facets spread as D n.h.

Citation: B. Karis, "Real shading in Unreal Engine 4", 2013 (the table); B. Walter et al. 2007,
doi:10.2312/EGWR/EGSR07/195-206 (facets).

Limits: no light between facets.
"""

import math
from functools import cache

import numpy as np
import torch
from torch.nn import functional

LOW, HIGH = 0.03, 0.8  # roughness of the table's first and last row
_ROWS, _COLUMNS = 16, 32
_FACETS = 64  # along each of two axes


def reflected_share(front: torch.Tensor, cosine: torch.Tensor, alpha: torch.Tensor) -> torch.Tensor:
    """Return the share of uniform light that a surface reflects toward the camera.

    Parameters
    ----------
    front : (..., 3) tensor
        Reflectance at normal incidence; 0: no gloss, which reflects nothing.
    cosine : (..., 1) tensor
        Of the angle between normal and camera, in [0, 1].
    alpha : (..., 1) tensor
        GGX roughness.

    Returns
    -------
    (..., 3) tensor
    """
    row = torch.log(alpha / LOW) * (2 / math.log(HIGH / LOW)) - 1
    place = torch.cat([2 * torch.sqrt(cosine.clamp(0, 1)) - 1, row], dim=-1)
    found = functional.grid_sample(
        _table().to(place),
        place.reshape(1, -1, 1, 2),
        padding_mode="border",
        align_corners=True,
    )
    whole, grazing = found.reshape(2, *cosine.shape)
    return (front * (whole - grazing) + grazing) * (front > 0)


@cache
def _table() -> torch.Tensor:
    """a and b (1, 2, _ROWS, _COLUMNS) by log roughness and root of the cosine."""
    alphas = LOW * (HIGH / LOW) ** np.linspace(0, 1, _ROWS)
    cosines = np.maximum(np.linspace(0, 1, _COLUMNS) ** 2, 1e-3)
    rows = [[_integrals(alpha, cosine) for cosine in cosines] for alpha in alphas]
    return torch.from_numpy(np.array(rows).transpose(2, 0, 1)[None]).float()


def _integrals(alpha: float, cosine: float) -> tuple[float, float]:
    """a and b for one roughness and one cosine."""
    share, turn = np.meshgrid(
        (np.arange(_FACETS) + 0.5) / _FACETS, (np.arange(_FACETS) + 0.5) * np.pi / _FACETS
    )
    leaning = np.sqrt((1 - share) / (1 + (alpha**2 - 1) * share))  # n.h
    across = np.sqrt(1 - leaning**2) * np.cos(turn)
    deviation = np.sqrt(1 - cosine**2) * across + cosine * leaning  # v.h
    light = 2 * deviation * leaning - cosine  # n.l
    lit = (light > 0) & (deviation > 0)
    masked = _masking(alpha, cosine) * _masking(alpha, np.where(lit, light, 1))
    weight = np.where(lit, masked * deviation / (leaning * cosine), 0)
    grazing = weight * (1 - np.clip(deviation, 0, 1)) ** 5
    return float(weight.mean()), float(grazing.mean())


def _masking(alpha: float, cosine: np.ndarray | float) -> np.ndarray | float:
    return 2 * cosine / (cosine + np.sqrt(alpha**2 + (1 - alpha**2) * cosine**2))
