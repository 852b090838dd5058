"""Cut-outs and their shadows, placed in front of backgrounds.

Problem: an object in a photo stands on something, and casts a shadow on it.

Equation: from the back to the front, light I <- (1 - a) I (1 - s) + a B for each object with light
B, coverage a and shadow s. s is the maximum of a cast shadow and a contact shadow. The cast shadow
is the coverage, sheared onto the ground to (x + h k_x, b + h k_y) for the height h above its lowest
row b, and blurred. The contact shadow is the coverage, moved by a few pixels and blurred.

Limits: objects are not lit by their background; shadows are those of flat cut-outs.
"""

import torch
from torch.nn import functional

from ..world.camera import decoded_srgb
from ..world.tensor_batch import chosen
from .scenes import PastedObjects

_HALVED = (0.62, 0.31)  # relative lengths below which the next smaller level is sampled
_COARSE = 2  # pixels per pixel of the shadow
_FILTERS = (3, 3, 5)  # widths of the box filters, pixels; a shadow passes the first few


class CutOuts:
    """Image pyramids of cut-outs, on the device.

    Parameters
    ----------
    cutouts : (N, 4, side, side) uint8 tensor
        As of `Ingredients`.
    """

    def __init__(self, cutouts: torch.Tensor) -> None:
        # in the order of their coverage, see `variation`
        order = cutouts[:, 3].flatten(1).float().mean(1).argsort(stable=True)
        self._levels = [cutouts[order]]
        for _ in _HALVED:
            self._levels.append(_halved(self._levels[-1]))
        self._linear = decoded_srgb(torch.arange(256, device=cutouts.device) / 255)

    @staticmethod
    def levels(lengths: torch.Tensor) -> torch.Tensor:
        """Choose the levels of the pyramids.

        Parameters
        ----------
        lengths : (N,) tensor
            Of the objects, relative to those in the finest level.

        Returns
        -------
        (N,) int64 tensor
            0: the finest, 1: half its resolution, and so on.
        """
        return (lengths[:, None] < torch.tensor(_HALVED)).sum(1)

    def placed(
        self, objects: PastedObjects, levels: dict[int, torch.Tensor], side: int
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Sample cut-outs at their places in the frame.

        Parameters
        ----------
        objects : PastedObjects
        levels : dict of int to (n,) int64 tensor
            The objects of each level, see `levels`, on the device.
        side : int
            Of the frame, pixels.

        Returns
        -------
        foreground : (N, 3, side, side) tensor
            Light times coverage.
        cover : (N, 1, side, side) tensor
        """
        theta, index = objects.to_cutout, chosen(objects.cutout, len(self._levels[0]))
        found = theta.new_empty(len(objects), 4, side, side)
        for level, rows in levels.items():
            coded = self._levels[level][index[rows]]
            cover = coded[:, 3:].float() / 255
            shown = torch.arange(len(rows), device=rows.device)[:, None]
            colours = coded[shown, objects.channels[rows]]
            layers = torch.cat([self._linear[colours.long()] * cover, cover], dim=1)
            size = [len(rows), 4, side, side]
            grid = functional.affine_grid(theta[rows], size, align_corners=False)
            found[rows] = functional.grid_sample(layers, grid, align_corners=False)
        cover = found[:, 3:]
        mean = found[:, :3].mean((1, 2, 3)) / cover.mean((1, 2, 3)).clamp(min=1e-4)
        gain = objects.gain / mean.clamp(min=0.02)[:, None]
        return found[:, :3] * gain[..., None, None], cover


def _halved(cutouts: torch.Tensor) -> torch.Tensor:
    """Cut-outs (N, 4, s, s) of 8 bits, downsampled by 2."""
    cover = cutouts[:, 3:].float()
    colours = functional.avg_pool2d(cutouts[:, :3].float() * cover, 2)
    cover = functional.avg_pool2d(cover, 2)
    return torch.cat([colours / cover.clamp(min=1), cover], dim=1).round().byte()


def shadows(cover: torch.Tensor, objects: PastedObjects) -> torch.Tensor:
    """Compute the shadows of objects.

    Parameters
    ----------
    cover : (N, 1, side, side) tensor
    objects : PastedObjects

    Returns
    -------
    (N, 1, side, side) tensor
        Fraction of the light that is lost.
    """
    full, cover = cover.shape[-1], functional.avg_pool2d(cover, _COARSE)
    side, number = full // _COARSE, len(objects)
    across = (torch.arange(side, device=cover.device) + 0.5) * (2 / side) - 1
    low = torch.where(cover.amax(3)[:, 0] > 0.5, across, -1.0).amax(1)
    grid = functional.affine_grid(
        _shadow_maps(objects, low), [2 * number, 1, side, side], align_corners=False
    )
    maps = functional.grid_sample(cover.repeat(2, 1, 1, 1), grid, align_corners=False)
    maps = _blurred(maps, objects.blur.repeat(2)[:, None, None, None])
    maps = maps.view(2, number, 1, side, side) * objects.strength.T[..., None, None, None]
    return functional.interpolate(maps.amax(0), (full, full), mode="bilinear", align_corners=False)


def _shadow_maps(objects: PastedObjects, low: torch.Tensor) -> torch.Tensor:
    """The affine maps (2 N, 2, 3) from cast and contact shadows to the objects."""
    (lean, fall), one, none = objects.shear.T, torch.ones_like(low), torch.zeros_like(low)
    # height above the lowest row: h = (y - low) / fall
    cast = [one, -lean / fall, lean / fall * low, none, -1 / fall, low * (1 + 1 / fall)]
    contact = [one, none, -objects.contact[:, 0], none, one, -objects.contact[:, 1]]
    return torch.cat([torch.stack(part, 1).view(-1, 2, 3) for part in (cast, contact)])


def _blurred(maps: torch.Tensor, steps: torch.Tensor) -> torch.Tensor:
    """Maps after the first 0 to 3 box filters."""
    for k, width in enumerate(_FILTERS):
        wide = functional.avg_pool2d(maps, width, 1, width // 2, count_include_pad=False)
        maps = torch.where(steps > k, wide, maps)
    return maps
