"""Batches of rendered pictures of objects on tables, as `composites` makes them of cut-outs.

Problem: a few thousand pictures must serve for a hundred thousand photos.

Equation: a photo shows a whole picture, as the network's first pass sees it, or a part around the
object, as its second pass does; some are mirrored, some have their channels exchanged. Exposure,
white balance and the camera are those of `composites`.

Limits: one object, never none and never several: these come from composites.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch.nn import functional

from isc_core.masking.crops import MARGIN, size_in_frame
from isc_core.networks.mask_network import SIDE, Count

from .composites import (
    Composite,
    CompositeDraw,
    CompositeDraws,
    Composites,
    as_photographed,
    draw_cameras,
    hinted_truth,
)
from .hints import draw_hints
from .scenes import MAX_OBJECTS
from .tabletop_pictures import TabletopPicture

_CUT, _EXCHANGED = 0.6, 0.3  # shares of photos that show a part, and with other channels
_MARGINS = (0.3, 2.2)  # of a part, of the second pass's


class TabletopBatches:
    """Draws batches.

    Parameters
    ----------
    pictures : sequence of TabletopPicture
    size : int
        Photos of a batch.
    hint_share : float
        Share of photos with hints.
    side : int
        Of the photos, pixels: a multiple of 32.
    """

    def __init__(
        self,
        pictures: Sequence[TabletopPicture],
        size: int,
        hint_share: float = 0.5,
        side: int = SIDE,
    ) -> None:
        self._pictures, self._size = pictures, size
        self._hint_share, self._side = hint_share, side

    def __call__(self, rng: np.random.Generator) -> Composite:
        """Return the next batch.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        Composite
            On the CPU.
        """
        number, side = self._size, self._side
        chosen = rng.integers(len(self._pictures), size=number)
        placed = [_placed(self._pictures[int(k)], side, rng) for k in chosen]
        layers = torch.stack(placed)
        light, cover, frame = layers[:, :3], layers[:, 3:4], layers[:, 4:]
        hints = draw_hints(rng, number, self._hint_share, MAX_OBJECTS)
        cameras = draw_cameras(rng, number)
        target, count = (
            torch.ones(number, 1, dtype=torch.bool),
            torch.full((number,), int(Count.ONE)),
        )
        mask, maps, count = hinted_truth(cover, target, frame, count, hints)
        photo = as_photographed(light, frame, cameras, light)
        return Composite(photo, frame, maps, mask, count)


class WithTabletops:
    """Batches of composites and rendered pictures together.

    Parameters
    ----------
    draws : CompositeDraws
    composites : Composites
        Compose what the first draws.
    tabletops : TabletopBatches
    """

    def __init__(
        self, draws: CompositeDraws, composites: Composites, tabletops: TabletopBatches
    ) -> None:
        self._draws, self._composites, self._tabletops = draws, composites, tabletops

    def draw(self, rng: np.random.Generator) -> tuple[CompositeDraw, Composite]:
        """Draw a batch on the CPU, where workers do it.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        CompositeDraw, Composite
        """
        return self._draws(rng), self._tabletops(rng)

    def composed(self, drawn: tuple[CompositeDraw, Composite]) -> Composite:
        """Compose the first part of a batch, and join it with the second.

        Parameters
        ----------
        drawn : CompositeDraw, Composite
            As `draw` returns them.

        Returns
        -------
        Composite
            On the device of the composites.
        """
        first = self._composites.composed(drawn[0])
        return Composite.joined([first, drawn[1].to(first.photo.device)])


def _placed(picture: TabletopPicture, side: int, rng: np.random.Generator) -> torch.Tensor:
    """Light, coverage and frame (5, side, side) of a photo of the picture or of a part of it."""
    layers = np.concatenate([picture.light, picture.cover[..., None] / np.float32(255)], axis=2)
    if rng.random() < _CUT:
        layers = layers[_around(picture.cover > 127, rng)]
    if rng.random() < 0.5:
        layers = layers[:, ::-1]
    if rng.random() < _EXCHANGED:
        layers = layers[..., [*rng.permutation(3), 3]]
    tensor = torch.from_numpy(np.ascontiguousarray(layers)).permute(2, 0, 1)[None]
    size = size_in_frame((tensor.shape[2], tensor.shape[3]), side)
    small = functional.interpolate(tensor, size, mode="bilinear", antialias=True)[0]
    top, left = ((side - n) // 2 for n in size)
    framed = torch.zeros(5, side, side)
    framed[:4, top : top + size[0], left : left + size[1]] = small
    framed[4, top : top + size[0], left : left + size[1]] = 1
    return framed


def _around(mask: np.ndarray, rng: np.random.Generator) -> tuple[slice, slice]:
    """Rows and columns around the object, with random margins."""
    found = []
    spans = [np.flatnonzero(mask.any(axis)) for axis in (1, 0)]
    longest = max(int(span[-1] - span[0]) + 1 for span in spans)
    for span, length in zip(spans, mask.shape, strict=True):
        before, after = (int(MARGIN * longest * rng.uniform(*_MARGINS)) for _ in range(2))
        found.append(slice(max(int(span[0]) - before, 0), min(int(span[-1]) + 1 + after, length)))
    return found[0], found[1]
