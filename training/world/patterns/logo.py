"""Simple emblems: stars, rings, arrows, flowers, gears, crests, pictograms, letters in discs."""

from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

from .canvas import FINER, Painting, averaged
from .lettering import INK, draw_hand, fitted, laid, line, on_circle
from .typefaces import Script, typefaces
from .words import phrase


def logo(rng: np.random.Generator, side: int) -> Painting:
    """Draw one large emblem, one with a name, or a wallpaper of one.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
        Ink is 1.
    """
    fine, style = FINER * side, rng.random()
    canvas = Image.new("L", (fine, fine), 0)
    angle = float(rng.choice([0, 0, rng.normal(0, 15), rng.uniform(-180, 180)]))
    tileable = False
    if style < 0.45:
        size = fine * rng.uniform(0.5, 0.95)
        middle = tuple(fine * (0.5 + rng.normal(0, 0.04, 2)))
        laid(canvas, emblem(rng, round(size)), (middle[0], middle[1]), angle)
    elif style < 0.75:
        size = fine * rng.uniform(0.4, 0.6)
        laid(canvas, emblem(rng, round(size)), (fine / 2, fine * 0.38))
        name = fitted(phrase(rng, Script.LATIN, 1), draw_hand(rng), fine * 0.85, fine * 0.25)
        laid(canvas, name, (fine / 2, fine * 0.82))
        canvas = canvas.rotate(angle, Image.Resampling.BICUBIC)
    else:
        _wallpaper(rng, canvas, angle)
        tileable = True
    return Painting(averaged(np.asarray(canvas, float) / 255), tileable)


def emblem(rng: np.random.Generator, size: int) -> Image.Image:
    """Draw an emblem.

    Parameters
    ----------
    rng : numpy.random.Generator
    size : int
        Pixels of its side.

    Returns
    -------
    Image.Image
        Mode "L", 255 for ink.
    """
    shapes: tuple[Callable[[np.random.Generator, int], Image.Image], ...] = (
        _outline_shape,
        _outline_shape,
        _rings,
        _letter_in_disc,
        _crest,
        _roundel,
        _pictogram,
        _bars,
    )
    return shapes[int(rng.integers(len(shapes)))](rng, size)


def _wallpaper(rng: np.random.Generator, canvas: Image.Image, angle: float) -> None:
    """The same emblem in rows; those that cross an edge come in again on the other side."""
    fine, count = canvas.width, int(rng.integers(2, 6))
    step = fine / count
    one = emblem(rng, round(step * rng.uniform(0.5, 0.9))).rotate(
        angle, Image.Resampling.BICUBIC, expand=True
    )
    shift = 0.5 if count % 2 == 0 and rng.random() < 0.5 else 0
    for row in range(count):
        for column in range(-1, count + 1):
            laid(canvas, one, ((column + 0.5 + shift * (row % 2)) * step, (row + 0.5) * step))


def _polygon(size: int, x: np.ndarray, y: np.ndarray) -> Image.Image:
    """A filled outline; x and y from -1 to 1, y up."""
    image = Image.new("L", (size, size), 0)
    points = [((1 + a) * size / 2, (1 - b) * size / 2) for a, b in zip(x, y, strict=True)]
    ImageDraw.Draw(image).polygon(points, fill=INK)
    return image


def _disc(size: int, radius: float, level: int = INK) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    image = Image.new("L", (size, size), 0)
    draw = ImageDraw.Draw(image)
    _circle(draw, size, radius, level)
    return image, draw


def _circle(draw: ImageDraw.ImageDraw, size: int, radius: float, level: int) -> None:
    low, high = size / 2 * (1 - radius), size / 2 * (1 + radius)
    draw.ellipse((low, low, high, high), fill=level)


def _outline_shape(rng: np.random.Generator, size: int) -> Image.Image:
    """A star, flower, gear, heart, arrow, moon or bolt; some with a smaller one cut out."""
    name = int(rng.integers(7))
    turn = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    if name == 0:
        points = int(rng.integers(3, 13))
        turn = np.arange(2 * points) * np.pi / points
        radius = np.where(np.arange(2 * points) % 2, rng.uniform(0.3, 0.8), 1)
        x, y = radius * np.sin(turn), radius * np.cos(turn)
    elif name == 1:
        radius = 0.7 + rng.uniform(0.1, 0.3) * np.cos(rng.integers(3, 10) * turn)
        x, y = radius * np.sin(turn), radius * np.cos(turn)
    elif name == 2:
        radius = np.where(np.sin(turn * rng.integers(6, 18)) > 0, 1, rng.uniform(0.65, 0.9))
        x, y = radius * np.sin(turn), radius * np.cos(turn)
    elif name == 3:
        x = np.sin(turn) ** 3
        y = (13 * np.cos(turn) - 5 * np.cos(2 * turn) - 2 * np.cos(3 * turn)) / 17
    elif name == 4:
        shaft, head = rng.uniform(0.15, 0.45), rng.uniform(-0.2, 0.4)
        x = np.array([-1, head, head, 1, head, head, -1])
        y = np.array([shaft, shaft, 0.9, 0, -0.9, -shaft, -shaft])
    elif name == 5:
        half, inner = np.linspace(-np.pi / 2, np.pi / 2, 60), rng.uniform(0.3, 0.8)
        x = np.concatenate([np.cos(half), inner * np.cos(half[::-1])])
        y = np.concatenate([np.sin(half), np.sin(half[::-1])])
    else:
        x = np.array([0.1, -0.6, 0.0, -0.3, 0.6, 0.05, 0.5])
        y = np.array([1, 0, 0.05, -1, 0.25, 0.2, 1])
    image = _polygon(size, x, y)
    if rng.random() < 0.3:
        image.paste(0, (0, 0), _polygon(size, x * 0.75, y * 0.75))
    return image


def _rings(rng: np.random.Generator, size: int) -> Image.Image:
    image, draw = _disc(size, 1)
    edges = np.sort(rng.uniform(0.1, 0.95, int(rng.integers(1, 6))))[::-1]
    for k, radius in enumerate(edges):
        _circle(draw, size, radius, int(rng.integers(0, 160)) if k % 2 == 0 else INK)
    return image


def _letter_in_disc(rng: np.random.Generator, size: int) -> Image.Image:
    """One to three letters cut out of a disc or a square, or ringed."""
    if rng.random() < 0.6:
        image, draw = _disc(size, 1)
    else:
        image = Image.new("L", (size, size), 0)
        draw = ImageDraw.Draw(image)
        draw.rounded_rectangle((0, 0, size - 1, size - 1), size * rng.uniform(0, 0.3), fill=INK)
    hand = draw_hand(rng)
    sign = phrase(rng, hand.script, 1)[: int(rng.integers(1, 4))].strip() or "A"
    letters = fitted(sign, hand, size * 0.6, size * 0.75)
    place = ((size - letters.width) // 2, (size - letters.height) // 2)
    if rng.random() < 0.3:
        _circle(draw, size, 0.88, 0)
        image.paste(INK, place, letters)
    else:
        image.paste(0, place, letters)
    return image


def _crest(rng: np.random.Generator, size: int) -> Image.Image:
    """A shield, halved, quartered or with a band, and an emblem on it."""
    side = np.linspace(0, 1, 30)
    x = np.concatenate([[-0.85, 0.85], 0.85 * np.cos(side * np.pi / 2) ** 0.7, [0]])
    y = np.concatenate([[1, 1], 0.2 - 1.2 * side**1.1, [-1]])
    x, y = np.concatenate([x, -x[:1:-1]]), np.concatenate([y, y[:1:-1]])
    shield = _polygon(size, x, y)
    field = Image.new("L", (size, size), 0)
    draw, third = ImageDraw.Draw(field), size / 3
    pale = int(rng.integers(70, 200))
    style = int(rng.integers(5))
    if style == 0:
        draw.rectangle((0, 0, size / 2, size), fill=pale)
    elif style == 1:
        draw.rectangle((0, 0, size / 2, size / 2), fill=pale)
        draw.rectangle((size / 2, size / 2, size, size), fill=pale)
    elif style == 2:
        draw.line((0, size * 0.9, size, size * 0.1), fill=pale, width=round(third / 1.5))
    elif style == 3:
        draw.rectangle((0, third, size, 1.6 * third), fill=INK)
        draw.rectangle((1.3 * third, 0, 1.7 * third, size), fill=INK)
    else:
        points = [(0, 2 * third), (size / 2, third), (size, 2 * third)]
        draw.line(points, fill=INK, width=round(third / 2))
    if style != 3:
        laid(field, _outline_shape(rng, round(third)), (size / 2, size * 0.35))
    inner = shield.resize((round(size * 0.9),) * 2)
    crest = shield.copy()
    edge = (size - inner.width) // 2
    crest.paste(
        field.crop((edge, edge, edge + inner.width, edge + inner.height)), (edge, edge), inner
    )
    return crest


def _roundel(rng: np.random.Generator, size: int) -> Image.Image:
    """A ring of text around an emblem."""
    image, draw = _disc(size, 1)
    _circle(draw, size, 0.94, 0)
    hand, em = draw_hand(rng), size * rng.uniform(0.09, 0.14)
    around = phrase(rng, hand.script, int(rng.integers(3, 6)))
    laid(image, on_circle(around, hand, em, 0.79 * size / 2, 200), (size / 2, size / 2))
    if rng.random() < 0.5:
        outer, ring = _disc(size, 0.62)
        _circle(ring, size, 0.58, 0)
        laid(image, outer, (size / 2, size / 2))
    laid(image, _outline_shape(rng, round(size * 0.5)), (size / 2, size / 2))
    if rng.random() < 0.4:
        inverse, _ = _disc(size, 1)
        inverse.paste(0, (0, 0), image)
        return inverse
    return image


def _pictogram(rng: np.random.Generator, size: int) -> Image.Image:
    """A sign of a symbol font: sun, umbrella, telephone and the like."""
    if not any(Script.SYMBOLS in face.scripts for face in typefaces()):
        return _outline_shape(rng, size)
    hand = draw_hand(rng, Script.SYMBOLS)
    sign = Script.SYMBOLS.value[int(rng.integers(6))]
    image = Image.new("L", (size, size), 0)
    laid(image, line(sign, hand, size * 0.9), (size / 2, size / 2))
    return image


def _bars(rng: np.random.Generator, size: int) -> Image.Image:
    """Bars, chevrons or squares in a row."""
    image = Image.new("L", (size, size), 0)
    draw, count = ImageDraw.Draw(image), int(rng.integers(2, 6))
    step, fill = size / count, rng.uniform(0.4, 0.8)
    slant = rng.choice([0, rng.uniform(-0.5, 0.5)]) * step
    for k in range(count):
        low, high = k * step, (k + fill) * step
        top = size * rng.uniform(0, 0.6) if rng.random() < 0.5 else 0.0
        corners = [
            (low + slant, top),
            (high + slant, top),
            (high - slant, size),
            (low - slant, size),
        ]
        draw.polygon(corners, fill=INK if rng.random() < 0.8 else 150)
    return image
