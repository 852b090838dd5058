"""Histograms on a coarse grid over row, column and hue.

Problem: a statistic of all pixels that are near and of similar hue, for every pixel.

Equation: pixels vote into the eight cells around them, linearly; the votes are blurred over
neighbouring cells, a quantile is taken in each cell, and pixels interpolate it linearly.

Citation: J. Chen, S. Paris and F. Durand, "Real-time edge-aware image processing with the bilateral
grid", ACM Trans. Graph. 26(3), 103 (2007), doi:10.1145/1276377.1276506; here cells hold histograms
instead of means, and the third axis is the hue, which is periodic.

Limits: a cell's histogram resolves nothing finer than the cell; where few pixels vote, those of
similar hue everywhere count in their place.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...filters.correlation import correlated

_BLUR = np.array([0.25, 0.5, 0.25])
# Weight of all pixels' histogram in that of each hue, so that a hue without votes has a value.
_POOLED = 20.0


def hue_of(image: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the hue (H, W) in [0, 6): red 0, green 2, blue 4; 0 for grey.

    White light on top does not change it.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    low, high : (H, W) ndarray
        Smallest and largest channel.

    Returns
    -------
    (H, W) ndarray
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
    """A grid over a photo.

    Attributes
    ----------
    size : tuple of int
        Shape of the photo.
    cell : float
        Side of a cell in pixels.
    hues : int
        Cells around the circle of hues.
    """

    size: tuple[int, int]
    cell: float
    hues: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of cells down, across and around."""
        down, across = (int(np.ceil(n / self.cell)) + 2 for n in self.size)
        return down, across, self.hues

    def histograms(
        self, places: "Places", bins: np.ndarray, count: int, weight: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Collect votes.

        Parameters
        ----------
        places : Places
        bins : (n,) int ndarray
            From 0.
        count : int
            Number of bins.
        weight : (n,) ndarray
            Not negative.

        Returns
        -------
        near : (down, across, hues, count) ndarray
        everywhere : (hues, count) ndarray
        """
        cells = np.concatenate([cell * count + bins for cell, _ in places.corners])
        votes = np.bincount(
            cells,
            np.concatenate([share * weight for _, share in places.corners]),
            int(np.prod(self.shape)) * count,
        )
        near = correlated(votes.reshape(*self.shape, count), _BLUR, axis=2, periodic=True)
        everywhere = near.sum(axis=(0, 1))
        for axis in (0, 1):
            near = correlated(near, 2 * _BLUR, axis)
        total = everywhere.sum(axis=0) + 1e-9
        return near, everywhere + _POOLED * total / total.sum()

    def places(self, rows: np.ndarray, columns: np.ndarray, hue: np.ndarray) -> "Places":
        """Return the positions of pixels among the cells.

        Parameters
        ----------
        rows, columns : (n,) ndarray
            In pixels.
        hue : (n,) ndarray
            In [0, 6).

        Returns
        -------
        Places
        """
        at = np.stack([rows / self.cell, columns / self.cell, hue * (self.hues / 6)])
        first = np.floor(at).astype(np.int64)
        return Places(first, (at - first).astype(np.float32), self.shape)


@dataclass(frozen=True, eq=False)
class Places:
    """Positions of n pixels in a grid.

    Attributes
    ----------
    first : (3, n) ndarray
        The first cell along each axis.
    beyond : (3, n) ndarray
        Distance beyond it, in [0, 1).
    shape : tuple of int
        Of the grid.
    """

    first: np.ndarray
    beyond: np.ndarray
    shape: tuple[int, int, int]

    @cached_property
    def corners(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the eight cells around each pixel as flat indices (n,), and their weights (n,)."""
        return [
            self._corner(row, column, hue) for row in (0, 1) for column in (0, 1) for hue in (0, 1)
        ]

    def read(self, table: np.ndarray) -> np.ndarray:
        """Interpolate a table at the pixels, linearly.

        Parameters
        ----------
        table : (down, across, hues) ndarray
            One value for each cell.

        Returns
        -------
        (n,) float32 ndarray
        """
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
    """Return a quantile of each histogram, linear inside a bin.

    Parameters
    ----------
    histograms : (..., bins) ndarray
    share : float
        In [0, 1].

    Returns
    -------
    (...) ndarray
        In [0, 1] of the histograms' range.
    """
    summed = np.cumsum(histograms, axis=-1)
    target = share * summed[..., -1]
    bin_ = np.minimum((summed < target[..., None]).sum(axis=-1), histograms.shape[-1] - 1)[
        ..., None
    ]
    inside = np.take_along_axis(histograms, bin_, -1)[..., 0]
    before = np.take_along_axis(summed, bin_, -1)[..., 0] - inside
    return (
        bin_[..., 0] + np.clip((target - before) / np.maximum(inside, 1e-9), 0, 1)
    ) / histograms.shape[-1]
