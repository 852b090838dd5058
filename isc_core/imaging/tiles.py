"""Tiles of a map whose values depend on near pixels alone.

Each tile is computed with what is around it, and only its inner part is kept. Where that covers all
that a value depends on, there is no seam, and results do not depend on the size of the tiles.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import InputError

Place = tuple[slice, slice]


@dataclass(frozen=True)
class Tile:
    """One tile of a map.

    Attributes
    ----------
    inner, outer : tuple of slice
        Rows and columns that are wanted, and those that are looked at.
    own : tuple of slice
        `inner` within `outer`.
    """

    inner: Place
    outer: Place
    own: Place


def tiles_of(mask: np.ndarray, side: int, overlap: int, multiple: int) -> Iterator[Tile]:
    """Cover an object with tiles; what is beside it is left out.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        H and W are multiples of `multiple`.
    side : int
        Most rows and columns of a tile, without what is around it: a multiple of `multiple`.
    overlap : int
        Pixels around a tile that are looked at, as far as the map has them: another multiple.
    multiple : int
        All places in the map that tiles begin and end at are multiples of it.

    Yields
    ------
    Tile
        In rows from the top, in each row from the left.

    Raises
    ------
    InputError
        If the tiles are smaller than their overlap.
    """
    if side < overlap:
        raise InputError(
            f"tiles of {side} pixels are smaller than their overlap of {overlap}: use larger ones"
        )
    for top in range(0, mask.shape[0], side):
        band = mask[top : top + side]
        for columns in _divided(band.any(axis=0), side, multiple):
            rows = next(_divided(band[:, columns].any(axis=1), side, multiple), None)
            if rows is not None:
                inner = slice(top + rows.start, top + rows.stop), columns
                yield _tile(inner, mask.shape, overlap)


def _divided(used: np.ndarray, side: int, multiple: int) -> Iterator[slice]:
    """Parts of about equal length of what is `used` (n,), none longer than `side`."""
    if not used.any():
        return
    places = np.flatnonzero(used)
    first = int(places[0]) // multiple * multiple
    last = -(-(int(places[-1]) + 1) // multiple) * multiple
    count = -(-(last - first) // side)
    length = -(-(last - first) // (count * multiple)) * multiple
    for start in range(first, last, length):
        yield slice(start, min(start + length, last))


def _tile(inner: Place, shape: tuple[int, ...], overlap: int) -> Tile:
    rows, columns = (
        slice(max(one.start - overlap, 0), min(one.stop + overlap, size))
        for one, size in zip(inner, shape, strict=True)
    )
    own = tuple(
        slice(one.start - wide.start, one.stop - wide.start)
        for one, wide in zip(inner, (rows, columns), strict=True)
    )
    return Tile(inner, (rows, columns), (own[0], own[1]))
