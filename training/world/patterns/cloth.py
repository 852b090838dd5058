"""Cloth: plain weave, twill and denim, knit.

Equation: threads are rounded ridges; which of two crossing threads lies on top follows the weave's
table, (row + column) mod n for a twill. A knitted stitch is a V of two slanted loops.

Limits: a thread is at least three pixels wide.
"""

import numpy as np

from .canvas import FINER, Painting, averaged, filtered_noise, places, stretched


def cloth(rng: np.random.Generator, side: int) -> Painting:
    """Draw a woven or knitted cloth, plain or with coloured threads.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    values = _knit(rng, side) if rng.random() < 0.3 else _weave(rng, side)
    fine = len(values)
    worn = rng.uniform(0, 0.25) * filtered_noise(rng, fine, 3)
    fluff = rng.uniform(0, 0.15) * filtered_noise(rng, fine, 0.5, 8)
    return Painting(stretched(averaged(values + worn + fluff)), True)


def _threads(rng: np.random.Generator, side: int, least: int) -> int:
    """An even number of threads a side, at least three pixels each."""
    return 2 * round(np.exp(rng.uniform(np.log(min(least, side / 4)), np.log(side / 3))) / 2)


def _weave(rng: np.random.Generator, side: int) -> np.ndarray:
    x, y = places(FINER * side)
    repeat = int(rng.choice([2, 3, 4, 4]))  # 2: plain; 3, 4: twills
    count = max(repeat, _threads(rng, side, 16) // repeat * repeat)
    u, v = x * count, y * count
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    on_top = (row + column) % repeat < max(1, repeat // 2)
    warp = np.sqrt(np.clip(np.sin(np.pi * (u % 1)), 0, 1))
    weft = np.sqrt(np.clip(np.sin(np.pi * (v % 1)), 0, 1))
    relief = np.where(on_top, warp * (0.6 + 0.4 * weft), weft * (0.6 + 0.4 * warp))
    uneven = rng.uniform(0, 0.3)
    dyes = rng.random((2, count)) * uneven
    if rng.random() < 0.4:  # a stripe or a check is woven in
        band = max(1, count // int(rng.integers(2, 9)))
        dyes += np.arange(count) // band % 2 * rng.uniform(0.2, 0.8)
        dyes[1] *= rng.random() < 0.6
    dyes[0] += rng.uniform(0, 0.6)  # denim: a dyed warp over a white weft
    return np.asarray(
        relief * rng.uniform(0.2, 0.8) + np.where(on_top, dyes[0][column], dyes[1][row])
    )


def _knit(rng: np.random.Generator, side: int) -> np.ndarray:
    x, y = places(FINER * side)
    count = max(6, _threads(rng, side, 6) // 2)
    u, v = x * count, y * count * int(rng.choice([1, 1, 2]))
    slant = np.abs(u % 1 - 0.5) * 2  # 0 in the middle of a stitch
    along = (v + rng.uniform(0.5, 1) * slant) % 1
    loop = np.sin(np.pi * along) * np.sin(np.pi * np.clip(slant, 0.05, 1)) ** 0.5
    rows = np.floor(v + rng.uniform(0.5, 1) * slant).astype(int) % int(v.max() + 1)
    bands = np.repeat(rng.uniform(0, 1, 64), int(rng.integers(1, 6)))
    striped = float(rng.random() < 0.4) * rng.uniform(0.3, 1)
    return np.asarray(loop + striped * np.rint(bands[rows % len(bands)]))
