"""Tiles of a map whose values depend only on near pixels.

Each tile is computed with its surroundings, and only its inner part is kept. Where these include
all pixels that a value depends on, there are no seams, and results do not depend on the size of the
tiles.
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
        Rows and columns of the result, and of the input.
    own : tuple of slice
        `inner` within `outer`.
    """

    inner: Place
    outer: Place
    own: Place


def tiles_of(mask: np.ndarray, side: int, overlap: int, multiple: int) -> Iterator[Tile]:
    """Cover an object with tiles.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        H and W are multiples of `multiple`.
    side : int
        Largest number of rows and columns of a tile without its surroundings, a multiple of
        `multiple`.
    overlap : int
        Pixels around a tile that are read, clipped at the map; a multiple of `multiple`.
    multiple : int
        Tiles begin and end at multiples of it.

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
    """Intervals of about equal length that cover what is `used` (n,), none longer than `side`."""
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
