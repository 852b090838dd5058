"""Blocks of rows: maps that depend on near pixels alone are made a block at a time.

Intermediate arrays then have the size of a block, whatever the photo's. Results are those of the
whole map, bit for bit, where each value depends on rows at most `halo` away.
"""

from collections.abc import Iterator
from dataclasses import dataclass

_PIXELS = 1 << 18


@dataclass(frozen=True)
class RowBlock:
    """Some rows of a map.

    Attributes
    ----------
    rows : slice
        The rows.
    wide : slice
        With those around them that the map has.
    own : slice
        `rows` within `wide`.
    """

    rows: slice
    wide: slice
    own: slice


def row_blocks(shape: tuple[int, ...], halo: int = 0, pixels: int = _PIXELS) -> Iterator[RowBlock]:
    """Divide a map into blocks of rows.

    Parameters
    ----------
    shape : tuple of int
        (H, W, ...) of the map.
    halo : int
        Rows around a block that its values depend on.
    pixels : int
        Of a block, about; it has at least one row.

    Yields
    ------
    RowBlock
        From the top.
    """
    height = shape[0]
    count = max(1, pixels // max(1, shape[1]))
    for first in range(0, height, count):
        last = min(first + count, height)
        top, bottom = max(first - halo, 0), min(last + halo, height)
        yield RowBlock(slice(first, last), slice(top, bottom), slice(first - top, last - top))
