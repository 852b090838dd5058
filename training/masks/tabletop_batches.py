"""Batches of rendered pictures of objects on tables, as `composites` makes them of cut-outs.

Problem: a few thousand pictures must serve for a hundred thousand photos.

Equation: a photo shows a whole picture, as the network's first pass sees it, or a part around the
objects, as its second pass does; some parts cut one object, as the frame of a photo does. Some
photos are mirrored, some have their channels exchanged. Exposure, white balance and the camera are
those of `composites`.

Limits: the light of a cut object shows what lies outside the frame.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch.nn import functional

from isc_core.masking.crops import MARGIN, size_in_frame
from isc_core.networks.mask_network import SIDE, Count

from ..tabletops.pictures import TabletopPicture
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

_PART, _EXCHANGED = 0.6, 0.3  # shares of photos that show a part, and with other channels
_MARGINS = (0.3, 2.2)  # of a part, of the second pass's
_CUT = 0.25  # share of the parts with one object that cut it
_CUT_OFF = (0.05, 0.45)  # of the object's extent
_SECOND_SIDE = 0.3  # share of these with a second side cut
_EMPTY = (0.4, 1.0)  # sides of a part without an object, of the picture's


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
        number = self._size
        chosen = [self._pictures[int(k)] for k in rng.integers(len(self._pictures), size=number)]
        objects = torch.tensor([picture.covers.shape[2] for picture in chosen])
        most = max(int(objects.max()), 1)
        layers = torch.stack([_placed(picture, most, self._side, rng) for picture in chosen])
        light, frame, covers = layers[:, :3], layers[:, 3:4], layers[:, 4:]
        hints = draw_hints(rng, number, self._hint_share, MAX_OBJECTS)
        cameras = draw_cameras(rng, number)
        target = torch.arange(most) < objects[:, None]
        count = torch.tensor([int(picture.count) for picture in chosen])
        mask, maps, count = hinted_truth(covers, target, frame, count, hints)
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


def _placed(
    picture: TabletopPicture, most: int, side: int, rng: np.random.Generator
) -> torch.Tensor:
    """Light, frame and coverages (4 + most, side, side) of a photo of the picture, or of a part."""
    shares = picture.covers / np.float32(255)
    layers = np.concatenate([picture.light, shares], axis=2)
    if rng.random() < _PART:
        layers = layers[_part(picture, rng)]
    if rng.random() < 0.5:
        layers = layers[:, ::-1]
    if rng.random() < _EXCHANGED:
        layers = layers[..., [*rng.permutation(3), *range(3, layers.shape[2])]]
    tensor = torch.from_numpy(np.ascontiguousarray(layers)).permute(2, 0, 1)[None]
    size = size_in_frame((tensor.shape[2], tensor.shape[3]), side)
    small = functional.interpolate(tensor, size, mode="bilinear", antialias=True)[0]
    top, left = ((side - n) // 2 for n in size)
    framed = torch.zeros(4 + most, side, side)
    inside = framed[:, top : top + size[0], left : left + size[1]]
    inside[:3], inside[3], inside[4 : 1 + len(small)] = small[:3], 1, small[3:]
    return framed


def _part(picture: TabletopPicture, rng: np.random.Generator) -> tuple[slice, slice]:
    """Rows and columns around the objects, with random margins; without an object, any."""
    shown = picture.cover > 0.5
    if not shown.any():
        return _window(shown.shape[0], rng), _window(shown.shape[1], rng)
    spans = [np.flatnonzero(shown.any(axis)) for axis in (1, 0)]
    longest = max(int(span[-1] - span[0]) + 1 for span in spans)
    margins = MARGIN * longest * rng.uniform(*_MARGINS, (2, 2))
    if picture.count == Count.ONE and rng.random() < _CUT:
        axis, end = (int(k) for k in rng.integers(2, size=2))
        margins[axis, end] = -rng.uniform(*_CUT_OFF) * len(spans[axis])
        if rng.random() < _SECOND_SIDE:
            end = int(rng.integers(2))
            margins[1 - axis, end] = -rng.uniform(*_CUT_OFF) * len(spans[1 - axis])
    rows, columns = (
        slice(max(int(span[0] - before), 0), min(int(span[-1] + 1 + after), length))
        for span, (before, after), length in zip(spans, margins, shown.shape, strict=True)
    )
    return rows, columns


def _window(length: int, rng: np.random.Generator) -> slice:
    part = round(length * rng.uniform(*_EMPTY))
    first = int(rng.integers(length - part + 1))
    return slice(first, first + part)
