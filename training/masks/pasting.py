"""Bodies with their shadows, placed before backgrounds.

Equation: from the back to the front, light I <- (1 - a) I (1 - s) + a B for each body B of cover a
and the shadow s that it casts: its cover sheared onto the ground, to (x + h k_x, b + h k_y) for the
height h over its lowest row b, and blurred; and its cover, moved by a few pixels and blurred, where
it touches.

Limits: bodies are not lit by their background; shadows are those of flat cut-outs.
"""

import torch
from torch.nn import functional

from ..world.camera import decoded_srgb
from ..world.tensor_batch import chosen
from .scenes import PastedObjects

_HALVED = (0.62, 0.31)  # bodies smaller than that are taken from pictures of half the size
_COARSE = 2  # pixels of a pixel of shadow
_FILTERS = (3, 3, 5)  # pixels; a shadow goes through the first few


class CutOuts:
    """Cut-out bodies on the device that pastes them, in three sizes.

    Parameters
    ----------
    bodies : (N, 4, side, side) uint8 tensor
        As of `Ingredients`.
    """

    def __init__(self, bodies: torch.Tensor) -> None:
        # those of little cover come first, see `variation`
        order = bodies[:, 3].flatten(1).float().mean(1).argsort(stable=True)
        self._sizes = [bodies[order]]
        for _ in _HALVED:
            self._sizes.append(_halved(self._sizes[-1]))
        self._linear = decoded_srgb(torch.arange(256, device=bodies.device) / 255)

    @staticmethod
    def levels(lengths: torch.Tensor) -> torch.Tensor:
        """Choose the sizes of the pictures that objects are taken from.

        Parameters
        ----------
        lengths : (N,) tensor
            Of the objects relative to those in the largest pictures.

        Returns
        -------
        (N,) int64 tensor
            0: the largest, 1: half of it, and so on.
        """
        return (lengths[:, None] < torch.tensor(_HALVED)).sum(1)

    def placed(
        self, objects: PastedObjects, levels: dict[int, torch.Tensor], side: int
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Show objects where they stand.

        Parameters
        ----------
        objects : PastedObjects
        levels : dict of int to (n,) int64 tensor
            The objects of each level, see `levels`; all on the device.
        side : int
            Of the frame, pixels.

        Returns
        -------
        body : (N, 3, side, side) tensor
            Light times cover.
        cover : (N, 1, side, side) tensor
        """
        theta, index = objects.to_body, chosen(objects.body, len(self._sizes[0]))
        found = theta.new_empty(len(objects), 4, side, side)
        for level, rows in levels.items():
            coded = self._sizes[level][index[rows]]
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


def _halved(bodies: torch.Tensor) -> torch.Tensor:
    """Bodies (N, 4, s, s) of 8 bits, half as large."""
    cover = bodies[:, 3:].float()
    colours = functional.avg_pool2d(bodies[:, :3].float() * cover, 2)
    cover = functional.avg_pool2d(cover, 2)
    return torch.cat([colours / cover.clamp(min=1), cover], dim=1).round().byte()


def shadows(cover: torch.Tensor, objects: PastedObjects) -> torch.Tensor:
    """Cast the shadows of objects.

    Parameters
    ----------
    cover : (N, 1, side, side) tensor
    objects : PastedObjects

    Returns
    -------
    (N, 1, side, side) tensor
        Share of the light that is lost.
    """
    full, cover = cover.shape[-1], functional.avg_pool2d(cover, _COARSE)
    side, number = full // _COARSE, len(objects)
    across = (torch.arange(side, device=cover.device) + 0.5) * (2 / side) - 1
    low = torch.where(cover.amax(3)[:, 0] > 0.5, across, -1.0).amax(1)
    grid = functional.affine_grid(
        _to_casting(objects, low), [2 * number, 1, side, side], align_corners=False
    )
    maps = functional.grid_sample(cover.repeat(2, 1, 1, 1), grid, align_corners=False)
    maps = _blurred(maps, objects.blur.repeat(2)[:, None, None, None])
    maps = maps.view(2, number, 1, side, side) * objects.strength.T[..., None, None, None]
    return functional.interpolate(maps.amax(0), (full, full), mode="bilinear", align_corners=False)


def _to_casting(objects: PastedObjects, low: torch.Tensor) -> torch.Tensor:
    """The affine maps (2 N, 2, 3) from shadows, cast and touching, to what casts them."""
    (lean, fall), one, none = objects.shear.T, torch.ones_like(low), torch.zeros_like(low)
    # height over the lowest row: h = (y - low) / fall
    cast = [one, -lean / fall, lean / fall * low, none, -1 / fall, low * (1 + 1 / fall)]
    touching = [one, none, -objects.touch[:, 0], none, one, -objects.touch[:, 1]]
    return torch.cat([torch.stack(part, 1).view(-1, 2, 3) for part in (cast, touching)])


def _blurred(maps: torch.Tensor, steps: torch.Tensor) -> torch.Tensor:
    """Maps after 0 to 3 box filters."""
    for k, width in enumerate(_FILTERS):
        wide = functional.avg_pool2d(maps, width, 1, width // 2, count_include_pad=False)
        maps = torch.where(steps > k, wide, maps)
    return maps
