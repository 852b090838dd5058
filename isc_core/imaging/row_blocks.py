"""Blocks of rows, for maps whose values depend only on near pixels.

Intermediate arrays have the size of a block, for photos of any size. Results are bit-identical to
those of the whole map where each value depends on rows at most `halo` away.
"""

from collections.abc import Iterator
from dataclasses import dataclass

CACHED = 1 << 14
"""Pixels of a block whose intermediate arrays stay in a processor's cache."""
_PIXELS = 1 << 18


@dataclass(frozen=True)
class RowBlock:
    """Some rows of a map.

    Attributes
    ----------
    rows : slice
        The rows.
    wide : slice
        The rows with their halo, clipped at the map.
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
        Approximate number per block, which has at least one row.

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
