"""Prints and drawings on paper, packaging and crockery: labels, pages of text, a band of large
letters, brush strokes.
"""

from collections.abc import Callable

import numpy as np

from .colours import ink, pale, paper, pigment
from .fields import ASPECT, over, smooth_noise, softened
from .plate import FACES, Plate, curve, word, write_lines


def texture(rng: np.random.Generator, size: int) -> np.ndarray:
    """Draw a texture of a label, a page, a band of letters or a drawing.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    size : int
        Side in texels.

    Returns
    -------
    (size, size, 3) ndarray
        Linear Rec.709.
    """
    return (_label, _page, _band, _drawing)[rng.integers(4)](rng, size)


def print_covers(rng: np.random.Generator, size: int) -> list[np.ndarray]:
    """Draw the coverage of one or two inks, for a page of text or a drawing without colours.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    size : int
        Side in texels.

    Returns
    -------
    list of (size, size) ndarray
        Coverages in [0, 1].
    """
    makers: tuple[Callable[[np.random.Generator, int], list[np.ndarray]], ...] = (
        _page_covers,
        _drawing_covers,
    )
    return makers[rng.integers(2)](rng, size)


def _label(rng: np.random.Generator, size: int) -> np.ndarray:
    """A coloured package with two or three pale labels around it, each with a name, a frame, a
    motif and small print.
    """
    count = int(rng.integers(2, 4))
    width, height = rng.uniform(0.7, 0.85) * ASPECT / count, rng.uniform(0.45, 0.65)
    top, face = 0.5 - height / 2 + rng.uniform(-0.05, 0.05), int(rng.choice(FACES[1:]))
    ground, frame, letters = Plate(size), Plate(size), Plate(size)
    name = word(rng).upper() if face != FACES[-1] else word(rng).capitalize()
    start = rng.uniform(0, ASPECT)
    for number in range(count):
        left = start + number * ASPECT / count
        ground.box(left, top, width, height)
        frame.box(left + 0.02, top + 0.02, width - 0.04, height - 0.04, 0.008)
        letters.centred(
            name, left + width / 2, top + 0.36 * height, 0.22 * height, face, 0.82 * width, 0.14
        )
        frame.box(left + 0.1 * width, top + 0.43 * height, 0.8 * width, 0.012)
        write_lines(
            letters,
            rng,
            left + 0.12 * width,
            top + 0.48 * height,
            0.76 * width,
            3,
            0.055 * height,
            FACES[0],
        )
        frame.area(_blossom(rng, left + width / 2, top + 0.85 * height, 0.07 * height))
    base = np.broadcast_to(pigment(rng), (size, size, 3))
    base = over(base, paper(rng), ground.cover())
    return over(over(base, ink(rng), letters.cover()), pigment(rng), frame.cover())


def _page(rng: np.random.Generator, size: int) -> np.ndarray:
    """Paper with columns of text; headlines in a second ink."""
    base = np.broadcast_to(paper(rng), (size, size, 3))
    text, heads = _page_covers(rng, size)
    return over(over(base, ink(rng), text), pigment(rng), heads)


def _page_covers(rng: np.random.Generator, size: int) -> list[np.ndarray]:
    text, heads = Plate(size), Plate(size)
    columns, height = int(rng.integers(3, 6)), rng.uniform(0.017, 0.032)
    width, start, face = ASPECT / columns, rng.uniform(0, ASPECT), int(rng.choice(FACES[:3]))
    for column in range(columns):
        left, top = start + (column + 0.05) * width, 0.04
        while top < 0.9:
            if rng.random() < 0.15:
                heads.box(left, top, 0.86 * width, 0.12)
                top += 0.16
                continue
            heads.centred(
                word(rng).capitalize(),
                left + 0.43 * width,
                top + 1.8 * height,
                1.7 * height,
                face,
                0.8 * width,
                0.15,
            )
            lines = min(int(rng.integers(3, 8)), int((0.95 - top) / (1.9 * height)))
            write_lines(text, rng, left, top + 2.6 * height, 0.86 * width, lines, height, face)
            top += (2.6 + 1.9 * lines + 1.5) * height
    return [text.cover(), heads.cover()]


def _band(rng: np.random.Generator, size: int) -> np.ndarray:
    """A package in two colours with large letters around it, between two rules."""
    low, high = rng.uniform(0.22, 0.32), rng.uniform(0.6, 0.75)
    face, letters, ground = int(rng.choice(FACES[1:4])), Plate(size), Plate(size)
    ground.box(0, low, ASPECT, high - low)
    for edge in (low - 0.04, high + 0.025):
        letters.box(0, edge, ASPECT, 0.015)
    height, repeats = 0.45 * (high - low), int(rng.integers(2, 4))
    for number in range(repeats):
        middle = (number + 0.5) * ASPECT / repeats
        letters.centred(
            word(rng).upper(),
            middle,
            low + 0.55 * (high - low),
            height,
            face,
            0.85 * ASPECT / repeats,
            0.17,
        )
        write_lines(
            letters,
            rng,
            middle - 0.4 * ASPECT / repeats,
            low + 0.66 * (high - low),
            0.8 * ASPECT / repeats,
            2,
            0.03,
            FACES[1],
        )
    base = over(
        np.broadcast_to(pigment(rng), (size, size, 3)),
        pale(rng) if rng.random() < 0.5 else paper(rng),
        ground.cover(),
    )
    return over(base, ink(rng), letters.cover())


def _drawing(rng: np.random.Generator, size: int) -> np.ndarray:
    """Crockery with brush strokes in one or two colours of varying thickness."""
    base = np.broadcast_to(paper(rng), (size, size, 3))
    for cover in _drawing_covers(rng, size):
        wash = 0.85 + 0.15 * np.tanh(smooth_noise(rng, size, 6))
        base = over(base, ink(rng), softened(cover) * wash)
    return base


def _drawing_covers(rng: np.random.Generator, size: int) -> list[np.ndarray]:
    stems, blossoms = Plate(size), Plate(size)
    for _ in range(int(rng.integers(8, 18))):
        start = rng.uniform((0, 0.1), (ASPECT, 0.9))
        path = curve(start + np.cumsum(rng.normal(0, 0.12, (4, 2)), axis=0))
        stems.line(path, rng.uniform(0.006, 0.018))
        blossoms.area(_blossom(rng, path[-1, 0], path[-1, 1], rng.uniform(0.025, 0.06)))
    for edge in rng.uniform((0.03, 0.93), (0.06, 0.96)):
        stems.box(0, edge, ASPECT, rng.uniform(0.008, 0.02))
    return [stems.cover(), blossoms.cover()]


def _blossom(rng: np.random.Generator, x: float, y: float, radius: float) -> np.ndarray:
    """The outline (N, 2) of a flower, a star or a disc."""
    angle = np.linspace(0, 2 * np.pi, 97)[:-1]
    reach = radius * (
        1
        + rng.uniform(0, 0.45) * np.cos(int(rng.integers(3, 8)) * angle + rng.uniform(0, 2 * np.pi))
    )
    return np.stack([x + reach * np.cos(angle), y + reach * np.sin(angle)], axis=1)
