"""The smallest box around a mask, and parts of a frame."""

from dataclasses import dataclass

import numpy as np


def mask_slices(mask: np.ndarray, margin: int = 0) -> tuple[slice, slice]:
    """Return the rows and columns of the smallest box around a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        At least one pixel is set.
    margin : int, optional
        Pixels around the box, clipped at the frame.

    Returns
    -------
    rows, columns : slice
    """
    along = ((np.flatnonzero(mask.any(axis=1 - k)), mask.shape[k]) for k in (0, 1))
    rows, columns = (
        slice(max(int(set_[0]) - margin, 0), min(int(set_[-1]) + 1 + margin, size))
        for set_, size in along
    )
    return rows, columns


def mask_box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Return the smallest box around a mask as (x, y, width, height), in pixels.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        At least one pixel is set.

    Returns
    -------
    tuple of int
        x and y are the left column and the top row.
    """
    rows, columns = mask_slices(mask)
    return (
        int(columns.start),
        int(rows.start),
        int(columns.stop - columns.start),
        int(rows.stop - rows.start),
    )


def mask_diagonal(mask: np.ndarray) -> float:
    """Return the diagonal of the smallest box around a mask, in pixels.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        At least one pixel is set.

    Returns
    -------
    float
    """
    _, _, width, height = mask_box(mask)
    return float(np.hypot(height, width))


def misalignment(edge: int, factor: float) -> float:
    """Return how far an edge between pixels is from the nearest one of another grid.

    Parameters
    ----------
    edge : int
    factor : float
        Pixels of the other grid for one of this; both begin at 0.

    Returns
    -------
    float
        Pixels of the other grid, at most 1/2.
    """
    return abs(edge * factor - round(edge * factor))


def aligned_edge(candidates: range, factor: float) -> int:
    """Return the edge with the least `misalignment`, the first of several.

    Parameters
    ----------
    candidates : range
        Edges; not empty.
    factor : float
        As of `misalignment`.

    Returns
    -------
    int
    """
    return min(candidates, key=lambda edge: misalignment(edge, factor))


WORTHWHILE = 0.5
"""A part of a larger share of its frame saves too little."""


@dataclass(frozen=True)
class FramePart:
    """A rectangle of a frame.

    Attributes
    ----------
    rows, columns : slice
        Its pixels, with start and stop.
    shape : tuple of int
        Rows and columns of the frame.
    """

    rows: slice
    columns: slice
    shape: tuple[int, int]

    @classmethod
    def around(cls, mask: np.ndarray, margin: int) -> "FramePart":
        """Return the box of a mask with a margin, or the whole frame if it is half of that.

        Parameters
        ----------
        mask : (H, W) bool ndarray
            If no pixel is set, the whole frame is returned.
        margin : int
            Pixels around the box, clipped at the frame.

        Returns
        -------
        FramePart
        """
        shape = mask.shape[0], mask.shape[1]
        if not mask.any():
            return cls.whole(shape)
        part = cls(*mask_slices(mask, margin), shape)
        return part if part.share <= WORTHWHILE else cls.whole(shape)

    @classmethod
    def whole(cls, shape: tuple[int, int]) -> "FramePart":
        """Return the whole frame.

        Parameters
        ----------
        shape : tuple of int
            Its rows and columns.

        Returns
        -------
        FramePart
        """
        return cls(slice(0, shape[0]), slice(0, shape[1]), shape)

    @property
    def corner(self) -> tuple[int, int]:
        """(x, y) of its upper left pixel."""
        return self.columns.start, self.rows.start

    @property
    def share(self) -> float:
        """Its area over that of the frame."""
        height, width = self.size
        return height * width / (self.shape[0] * self.shape[1])

    def scaled(self, factor: float, shape: tuple[int, ...]) -> "FramePart":
        """Return the part in a frame of another size.

        Parameters
        ----------
        factor : float
            Size of that frame over the size of this one.
        shape : tuple of int
            Its rows and columns, first of all.

        Returns
        -------
        FramePart
        """
        if self.is_whole:
            return FramePart.whole((shape[0], shape[1]))
        rows, columns = (
            slice(min(round(factor * along.start), count), min(round(factor * along.stop), count))
            for along, count in zip((self.rows, self.columns), shape[:2], strict=True)
        )
        return FramePart(rows, columns, (shape[0], shape[1]))

    def within(self, outer: "FramePart") -> "FramePart":
        """Return what this part and another one of the same frame have in common, as a part of the
        latter.

        Parameters
        ----------
        outer : FramePart
            Its frame is that of the returned part.

        Returns
        -------
        FramePart
        """
        rows, columns = (
            slice(
                max(own.start, other.start) - other.start, min(own.stop, other.stop) - other.start
            )
            for own, other in ((self.rows, outer.rows), (self.columns, outer.columns))
        )
        return FramePart(rows, columns, outer.size)

    @property
    def size(self) -> tuple[int, int]:
        """Its rows and columns."""
        return self.rows.stop - self.rows.start, self.columns.stop - self.columns.start

    @property
    def is_whole(self) -> bool:
        """Whether it is the whole frame."""
        return self.share == 1

    def cut(self, values: np.ndarray) -> np.ndarray:
        """Return the values of the part.

        Parameters
        ----------
        values : (H, W, ...) ndarray
            Of the frame.

        Returns
        -------
        (h, w, ...) ndarray
            A view.
        """
        return values[self.rows, self.columns]

    def placed(self, values: np.ndarray, around: np.ndarray | None = None) -> np.ndarray:
        """Return values in the frame.

        Parameters
        ----------
        values : (h, w, ...) ndarray
            Of the part; rows and columns beyond it are left out.
        around : (...) ndarray, optional
            The value around the part; by default 0, which takes no memory until it is written.

        Returns
        -------
        (H, W, ...) ndarray
            The values themselves if the part is the whole frame.
        """
        if values.shape[:2] == self.shape:
            return values
        frame = np.zeros((*self.shape, *values.shape[2:]), values.dtype)
        if around is not None and around.any():
            frame[...] = around
        inside = self.cut(frame)
        inside[...] = values[: inside.shape[0], : inside.shape[1]]
        return frame
