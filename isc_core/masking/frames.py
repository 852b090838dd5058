"""Parts of a photo in the network's frame, and the way back.

A part is a rectangle of the photo, which may reach beyond it. It is averaged down, or enlarged, to
fill the frame's longer side, and placed in the middle.
"""

from dataclasses import dataclass

import numpy as np

from ..imaging.resampling import resampled
from ..networks.mask_network import POINT, SIDE, MaskNetwork, predict_mask
from .hints import Hints


@dataclass(frozen=True)
class Part:
    """A rectangle of a photo.

    Attributes
    ----------
    left, top, width, height : int
        Pixels; inside of the photo.
    """

    left: int
    top: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns."""
        return (
            slice(self.top, self.top + self.height),
            slice(self.left, self.left + self.width),
        )


@dataclass(frozen=True)
class PartPrediction:
    """What the network says of a part of a photo.

    Attributes
    ----------
    cover : (height, width) float32 ndarray
        Probability of the object at each pixel of the part.
    counts : (3,) ndarray
        Probabilities of none, one and several objects.
    """

    cover: np.ndarray
    counts: np.ndarray


def predict_part(
    light: np.ndarray, part: Part, hints: Hints, network: MaskNetwork | None, side: int = SIDE
) -> PartPrediction:
    """Ask the network for the mask of a part.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
        Linear; the whole photo.
    part : Part
    hints : Hints
        In pixels of `light`; those outside of the part are left out.
    network : MaskNetwork or None
        None: the shipped one.
    side : int
        Pixels of the frame, a multiple of 32.

    Returns
    -------
    PartPrediction
    """
    factor = side / max(part.width, part.height)
    # as many pixels on both sides of the middle, so that a mirrored photo is seen mirrored
    width, height = (
        min(max(2 * round(n * factor / 2), 2), side) for n in (part.width, part.height)
    )
    left, top = (side - width) // 2, (side - height) // 2
    place = slice(top, top + height), slice(left, left + width)
    small, frame = np.zeros((side, side, 3), np.float32), np.zeros((side, side), bool)
    small[place], frame[place] = resampled(light[part.slices], (height, width)), True
    scale = width / part.width, height / part.height
    drawn = _drawn(hints, part, scale, (left, top), side)
    found = predict_mask(small, frame, drawn, network)
    cover = resampled(found.cover[place], (part.height, part.width))
    return PartPrediction(cover.clip(0, 1), found.counts)


def _drawn(
    hints: Hints, part: Part, scale: tuple[float, float], place: tuple[int, int], side: int
) -> np.ndarray:
    """The hints (side, side, 3) as the network sees them."""
    maps = np.zeros((side, side, 3), np.float32)
    rows, columns = np.indices((side, side))

    def placed(x: float, y: float) -> tuple[float, float]:
        return (
            (x - part.left) * scale[0] + place[0],
            (y - part.top) * scale[1] + place[1],
        )

    for channel, points in enumerate((hints.points, hints.others)):
        for x, y in points:
            across, down = placed(x + 0.5, y + 0.5)
            near = (columns + 0.5 - across) ** 2 + (rows + 0.5 - down) ** 2 <= POINT**2
            maps[near, channel] = 1
    if hints.box is not None:
        x, y, wide, high = hints.box
        (left, top), (right, bottom) = placed(x, y), placed(x + wide, y + high)
        inside = (columns + 0.5 > left) & (columns + 0.5 < right)
        maps[inside & (rows + 0.5 > top) & (rows + 0.5 < bottom), 2] = 1
    return maps
