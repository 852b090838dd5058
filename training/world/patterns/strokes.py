"""Brush marks, scribbles and scratches: curves drawn one over the other.

Equation: a stroke is a quadratic Bezier curve. A brush mark is a bundle of such curves side by
side, each bristle of its own level.
"""

import numpy as np
from PIL import Image, ImageDraw

from .canvas import FINER, Painting, averaged


def strokes(rng: np.random.Generator, side: int) -> Painting:
    """Draw brush marks, scratches, hatching or scribbles.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    fine = FINER * side
    image = Image.new("L", (fine, fine), int(rng.choice([0, 0, rng.integers(0, 120)])))
    draw = ImageDraw.Draw(image)
    paint = (_brushes, _scratches, _hatching, _scribble)[int(rng.integers(4))]
    paint(rng, draw, fine)
    return Painting(averaged(np.asarray(image, float) / 255), False)


def _curve(
    rng: np.random.Generator, start: np.ndarray, step: np.ndarray, bend: float
) -> np.ndarray:
    """Points (16, 2) of a Bezier curve from `start` along `step`, bent sideways."""
    share = np.linspace(0, 1, 16)[:, None]
    middle = start + step / 2 + bend * rng.normal() * np.array([-step[1], step[0]])
    return np.asarray(
        (1 - share) ** 2 * start + 2 * share * (1 - share) * middle + share**2 * (start + step)
    )


def _line(draw: ImageDraw.ImageDraw, points: np.ndarray, level: float, width: float) -> None:
    draw.line(
        [(float(x), float(y)) for x, y in points],
        fill=int(np.clip(level, 0, 255)),
        width=max(1, round(width)),
        joint="curve",
    )


def _brushes(rng: np.random.Generator, draw: ImageDraw.ImageDraw, fine: int) -> None:
    angle, spread = rng.uniform(0, 2 * np.pi), rng.choice([0.15, 2.0])
    wide = fine * rng.uniform(0.03, 0.15)
    for _ in range(int(rng.integers(10, 80))):
        turn = angle + rng.normal(0, spread)
        along = np.array([np.cos(turn), np.sin(turn)])
        step = along * fine * rng.uniform(0.2, 0.9)
        path = _curve(rng, rng.uniform(-0.1, 1, 2) * fine, step, 0.15)
        level, bristles = rng.uniform(0, 255), max(3, round(wide / 4))
        for k in range(bristles):
            aside = (k / (bristles - 1) - 0.5) * wide * np.array([-along[1], along[0]])
            first, last = int(rng.integers(0, 3)), 16 - int(rng.integers(0, 4))
            shade = level + rng.normal(0, 25)
            _line(draw, path[first:last] + aside, shade, wide / bristles + 2)


def _scratches(rng: np.random.Generator, draw: ImageDraw.ImageDraw, fine: int) -> None:
    angle, spread = rng.uniform(0, np.pi), rng.choice([0.1, 0.5, 2.0])
    for _ in range(int(rng.integers(10, 120))):
        turn, long = angle + rng.normal(0, spread), fine * np.exp(rng.normal(-1.5, 0.8))
        step = long * np.array([np.cos(turn), np.sin(turn)])
        path = _curve(rng, rng.uniform(0, 1, 2) * fine, step, rng.choice([0, 0.1]))
        _line(draw, path, rng.uniform(90, 255), rng.choice([1, 2, 3, 6]))


def _hatching(rng: np.random.Generator, draw: ImageDraw.ImageDraw, fine: int) -> None:
    """Two or three layers of nearly parallel lines, each over a part of the map."""
    for _ in range(int(rng.integers(1, 4))):
        turn, gap = rng.uniform(0, np.pi), fine * rng.uniform(0.02, 0.08)
        along = np.array([np.cos(turn), np.sin(turn)])
        aside = np.array([-along[1], along[0]])
        width, level = gap * rng.uniform(0.15, 0.6), rng.uniform(120, 255)
        middle = fine * rng.uniform(0.3, 0.7, 2)
        for k in np.arange(-fine * 0.6, fine * 0.6, gap):
            long = fine * rng.uniform(0.4, 1.2)
            start = middle + (k + rng.normal(0, gap / 6)) * aside - along * long / 2
            _line(draw, _curve(rng, start, along * long, 0.02), level, width)


def _scribble(rng: np.random.Generator, draw: ImageDraw.ImageDraw, fine: int) -> None:
    """One long line that wanders: a pen, a thread, a vine."""
    for _ in range(int(rng.integers(1, 4))):
        steps = 600
        turn = np.cumsum(rng.normal(0, 0.25, steps)) + np.linspace(0, rng.normal(0, 30), steps)
        stride = fine * rng.uniform(0.008, 0.03)
        path = np.cumsum(stride * np.stack([np.cos(turn), np.sin(turn)], -1), 0)
        path = np.abs((path + fine * rng.random(2)) % (2 * fine) - fine)  # reflected at the edges
        _line(draw, path, rng.uniform(120, 255), fine * np.exp(rng.uniform(-5.2, -3.5)))
