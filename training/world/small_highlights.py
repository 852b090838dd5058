"""Small, sharp highlights on lit pictures: what lamps, windows and a flash leave on glossy objects.

Problem: lobes as wide as `training.world.recipes` draws them, on smooth bodies, make broad
highlights. A network that has seen few others takes small bright spots for print: dots are common.
Photos of plastic and glazed objects have mostly small ones.

Equation: a source in the direction l, seen from v = (0, 0, 1), is mirrored where the normal n is
near h = (l + v) / |l + v|. With the tangent coordinates u, w of n around h, n = h + u e_1 + w e_2
up to length, and a window of half sides a and b,

    t^2 = max(|u| - a, 0)^2 + max(|w| - b, 0)^2,    s = A (1 + t^2 / alpha^2)^-2,

the GGX distribution over its peak, where n.l > 0. A bar across the window divides some. A is a
random factor times the body's mean shading.

Citation: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206.

Limits: no Fresnel factor, no shadows, orthographic view. The sources add no diffuse light, as if
they were part of the surroundings.
"""

import math

import torch
from torch.nn import functional

from .lit_pictures import LitPictures

_MOST = 4  # sources of a picture
_LOG_ALPHA = (math.log(0.02), math.log(0.2))
_WINDOW, _LARGEST = 0.4, 0.15  # share of sources that are windows; half side, in units of |n - h|
_BAR = 0.008  # half width of the bar across a window
_LEVEL = (-0.4, 1.0)  # mean and deviation of the logarithm of A over the mean shading
_TINT = 0.08
_LOWEST = -0.3  # of sources' height: few shine from below
_KNOWN = 0.5  # share of the pictures with lamps of which one source is the strongest lamp


def small_highlights(pictures: LitPictures) -> torch.Tensor:
    """Draw small highlights for pictures.

    Parameters
    ----------
    pictures : LitPictures

    Returns
    -------
    (B, 3, SIDE, SIDE) tensor
        Specular light, not negative, 0 off the body.
    """
    layers = pictures.layers.float()
    normal, cover = layers[:, 9:12], pictures.cover.float()
    sources = 1 + torch.randint(_MOST, (len(layers),), device=layers.device)
    found = torch.zeros_like(normal)
    for k in range(_MOST):
        toward = _directions(pictures)
        if k == 0:
            known = (pictures.lamps > 0) & (torch.rand_like(toward[:, 0]) < _KNOWN)
            toward = torch.where(known[:, None], pictures.strongest, toward)
        found += _mirrored(normal, toward) * (k < sources)[:, None, None, None]
    shading = (layers[:, 6:9] * cover).sum((1, 2, 3)) / (3 * cover.sum((1, 2, 3)).clamp(min=1))
    return found * shading[:, None, None, None] * cover


def _directions(pictures: LitPictures) -> torch.Tensor:
    """Random unit vectors (B, 3) to sources."""
    drawn = torch.randn(len(pictures.layers), 3, device=pictures.layers.device)
    drawn = functional.normalize(drawn, dim=-1)
    height = torch.where(drawn[:, 1] < _LOWEST, -drawn[:, 1], drawn[:, 1])
    return torch.stack([drawn[:, 0], height, drawn[:, 2]], -1)


def _mirrored(normal: torch.Tensor, toward: torch.Tensor) -> torch.Tensor:
    """s (B, 3, SIDE, SIDE) of a source for each picture, for a mean shading of 1."""
    count = len(toward)

    def maps(values: torch.Tensor) -> torch.Tensor:
        return values[:, None, None, None]

    def uniform(low: float, high: float) -> torch.Tensor:
        return low + (high - low) * torch.rand(count, device=toward.device)

    middle = functional.normalize(toward + toward.new_tensor([0.0, 0, 1]) + 1e-4, dim=-1)
    first = functional.normalize(torch.cross(middle, torch.randn_like(middle), dim=-1), dim=-1)
    axes = torch.stack([middle, first, torch.cross(middle, first, dim=-1)], 1)
    along, u, w = torch.einsum("bij,bjhw->bihw", axes, normal).split(1, 1)
    u, w = u / along.clamp(min=0.1), w / along.clamp(min=0.1)
    window = (uniform(0, 1) < _WINDOW).float()
    a, b = (maps(window * uniform(0.02, _LARGEST)) for _ in range(2))
    beside = (u.abs() - a).clamp(min=0).square() + (w.abs() - b).clamp(min=0).square()
    alpha = maps(torch.exp(uniform(*_LOG_ALPHA)))
    lobe = (1 + beside / alpha.square()).square().reciprocal()
    barred = maps((uniform(0, 1) < 0.5).float() * window)
    lobe = lobe * (1 - barred * (u.abs() < _BAR).float())
    lit = (torch.einsum("bj,bjhw->bhw", toward, normal)[:, None] > 0) & (along > 0.1)
    level = torch.exp(_LEVEL[0] + _LEVEL[1] * torch.randn(count, device=toward.device))
    tint = torch.exp(_TINT * torch.randn(count, 3, 1, 1, device=toward.device))
    return maps(level) * tint * lobe * lit.float()
