"""What pixels of like hue do in each part of a photo: histograms on a coarse grid over row, column
and hue.

Problem: a statistic of all pixels that are near and of like hue, for every pixel. Equation: pixels
vote into the eight cells around them, linearly; the votes are blurred over neighbouring cells, a
quantile is taken in each cell, and pixels read it back, linearly.

Citation: J. Chen, S. Paris and F. Durand, "Real-time edge-aware image processing with the bilateral
grid", ACM Trans. Graph. 26(3), 103 (2007), doi:10.1145/1276377.1276506; here cells hold histograms
instead of means, and the third axis is the hue, which is round.

Limits: a cell's histogram knows nothing finer than the cell; where few pixels vote, those of like
hue everywhere count in their place.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

_BLUR = np.array([0.25, 0.5, 0.25])
# Every hue knows a little of all pixels, so that a hue without votes has an answer.
_OF_ALL = 20.0


def hue_of(image: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The hue (H, W), in [0, 6), of an image (H, W, 3) with smallest and largest channel `low`,
    `high`: red 0, green 2, blue 4.

    White light on top does not change it. 0 for grey.
    """
    red, green, blue = image[..., 0], image[..., 1], image[..., 2]
    over = np.maximum(high - low, np.finfo(image.dtype).tiny)
    warm = (green - blue) / over
    hue = np.where(
        red >= high,
        np.where(warm < 0, warm + 6, warm),
        np.where(green >= high, (blue - red) / over + 2, (red - green) / over + 4),
    )
    return np.where(hue >= 6, 0, hue).astype(image.dtype)


@dataclass(frozen=True)
class HueGrid:
    """Cells of `cell` pixels a side over a photo of shape `size`, and `hues` of them around the
    circle of hues.
    """

    size: tuple[int, int]
    cell: float
    hues: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Cells down, across and around."""
        down, across = (int(np.ceil(n / self.cell)) + 2 for n in self.size)
        return down, across, self.hues

    def histograms(
        self, places: "Places", bins: np.ndarray, count: int, weight: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Votes near and everywhere:

        (down, across, hues, count) and (hues, count), of `bins` (n,) from 0 with `weight` (n,) >=
        0.
        """
        cells = np.concatenate([cell * count + bins for cell, _ in places.corners])
        votes = np.bincount(
            cells,
            np.concatenate([share * weight for _, share in places.corners]),
            int(np.prod(self.shape)) * count,
        )
        near = votes.reshape(*self.shape, count)
        ndimage.convolve1d(near, _BLUR, axis=2, output=near, mode="wrap")
        everywhere = near.sum(axis=(0, 1))
        for axis in (0, 1):
            ndimage.convolve1d(near, 2 * _BLUR, axis=axis, output=near, mode="constant")
        total = everywhere.sum(axis=0) + 1e-9
        return near, everywhere + _OF_ALL * total / total.sum()

    def places(self, rows: np.ndarray, columns: np.ndarray, hue: np.ndarray) -> "Places":
        """Where pixels (n,) of these rows, columns and hues in [0, 6) lie among the cells."""
        at = np.stack([rows / self.cell, columns / self.cell, hue * (self.hues / 6)])
        first = np.floor(at).astype(np.int64)
        return Places(first, (at - first).astype(np.float32), self.shape)


@dataclass(frozen=True)
class Places:
    """Of n pixels the `first` (3, n) cell along each axis, how far beyond it they lie, `beyond` (3,
    n) in [0, 1), in a grid of `shape`.
    """

    first: np.ndarray
    beyond: np.ndarray
    shape: tuple[int, int, int]

    @cached_property
    def corners(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The eight cells around each pixel, as flat indices (n,), and its shares in them (n,)."""
        return [
            self._corner(row, column, hue) for row in (0, 1) for column in (0, 1) for hue in (0, 1)
        ]

    def read(self, table: np.ndarray) -> np.ndarray:
        """A table (down, across, hues) at the pixels (n,), linear between cells."""
        flat = np.ascontiguousarray(table, np.float32).ravel()
        return np.sum([share * flat[cell] for cell, share in self.corners], axis=0)

    def _corner(self, row: int, column: int, hue: int) -> tuple[np.ndarray, np.ndarray]:
        y, x, h = self.first
        cell = ((y + row) * self.shape[1] + x + column) * self.shape[2] + (h + hue) % self.shape[2]
        shares = [
            beyond if step else 1 - beyond
            for step, beyond in zip((row, column, hue), self.beyond, strict=True)
        ]
        return cell, shares[0] * shares[1] * shares[2]


def quantile(histograms: np.ndarray, share: float) -> np.ndarray:
    """The `share` quantile, in [0, 1] of the histograms' range, of each of (..., bins) histograms,
    linear inside a bin.
    """
    summed = np.cumsum(histograms, axis=-1)
    wanted = share * summed[..., -1]
    bin_ = np.minimum((summed < wanted[..., None]).sum(axis=-1), histograms.shape[-1] - 1)[
        ..., None
    ]
    inside = np.take_along_axis(histograms, bin_, -1)[..., 0]
    before = np.take_along_axis(summed, bin_, -1)[..., 0] - inside
    return (
        bin_[..., 0] + np.clip((wanted - before) / np.maximum(inside, 1e-9), 0, 1)
    ) / histograms.shape[-1]
