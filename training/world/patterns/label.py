"""Labels as on jars and boxes: frame, name, small print, table, bar code, emblem.

A label is laid out from top to bottom: parts take a share of the height each, until none is left.
"""

from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

from .canvas import FINER, Painting, averaged
from .lettering import INK, Hand, draw_hand, fitted, laid, line, paragraph
from .logo import emblem
from .words import number, phrase, word

_Part = Callable[[np.random.Generator, Hand, int, int], Image.Image]


def label(rng: np.random.Generator, side: int) -> Painting:
    """Draw a label, straight or turned, whole or cut off.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    fine = FINER * side
    width, height = (round(fine * share) for share in rng.uniform(0.65, 1.15, 2))
    paper = _sheet(rng, width, height)
    body = int(rng.choice([0, 255, rng.integers(60, 200)]))
    canvas = Image.new("L", (fine, fine), body)
    angle = float(rng.choice([0, rng.normal(0, 4), rng.normal(0, 25), 90, 180]))
    shape = _shape(rng, width, height)
    paper, shape = (
        one.rotate(angle, Image.Resampling.BICUBIC, expand=True) for one in (paper, shape)
    )
    middle = fine * (0.5 + rng.normal(0, 0.06, 2))
    place = (round(middle[0] - paper.width / 2), round(middle[1] - paper.height / 2))
    canvas.paste(paper, place, shape)
    return Painting(averaged(np.asarray(canvas, float) / 255), False)


def _shape(rng: np.random.Generator, width: int, height: int) -> Image.Image:
    """The outline of the sheet: square or round corners, an oval."""
    shape = Image.new("L", (width, height), 0)
    draw, box = ImageDraw.Draw(shape), (0, 0, width - 1, height - 1)
    if rng.random() < 0.15:
        draw.ellipse(box, fill=INK)
    else:
        draw.rounded_rectangle(box, min(width, height) * rng.choice([0, 0, 0.05, 0.15]), fill=INK)
    return shape


def _sheet(rng: np.random.Generator, width: int, height: int) -> Image.Image:
    """The printed sheet: ink 255 on 0, or levels between."""
    ink = Image.new("L", (width, height), 0)
    draw, unit = ImageDraw.Draw(ink), min(width, height) / 100
    margin = unit * rng.uniform(3, 9)
    for inset in (1, 1.6)[: int(rng.integers(0, 3))]:
        box = (margin * inset / 2,) * 2 + (width - margin * inset / 2, height - margin * inset / 2)
        draw.rounded_rectangle(
            box,
            unit * rng.choice([0, 6]),
            outline=INK,
            width=round(1 + unit * rng.uniform(0, 2)),
        )
    hand, left = draw_hand(rng), margin * 1.4
    top, inner = left, round(width - 2 * left)
    parts: tuple[_Part, ...] = (_name, _print, _bar_code, _table, _picture, _band, _numbers)
    chances = np.array((0.3, 0.22, 0.1, 0.12, 0.12, 0.08, 0.06))
    order = [_name, *(parts[k] for k in rng.choice(len(parts), 6, p=chances / chances.sum()))]
    for part in order if rng.random() < 0.8 else order[::-1]:
        tall = round(min(height * rng.uniform(0.12, 0.34), height - left - top))
        if tall < 6 * unit:
            break
        laid(ink, part(rng, hand, inner, tall), (width / 2, top + tall / 2))
        top += tall + unit * rng.uniform(1, 4)
    low = int(rng.choice([0, 0, rng.integers(0, 120)]))
    levels = np.linspace(low, 255, 256)
    levels = levels if rng.random() < 0.4 else 255 - levels
    return ink.point([round(level) for level in levels])


def _blank(width: int, height: int) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    image = Image.new("L", (width, height), 0)
    return image, ImageDraw.Draw(image)


def _name(rng: np.random.Generator, hand: Hand, width: int, height: int) -> Image.Image:
    """A name as large as fits, in some cases reversed out of a bar."""
    image, draw = _blank(width, height)
    one = fitted(
        phrase(rng, hand.script, int(rng.integers(1, 3))), hand, width * 0.95, height * 0.9
    )
    if rng.random() < 0.25:
        draw.rectangle((0, 0, width, height), fill=INK)
        image.paste(0, ((width - one.width) // 2, (height - one.height) // 2), one)
    else:
        laid(image, one, (width / 2, height / 2))
    return image


def _print(rng: np.random.Generator, hand: Hand, width: int, height: int) -> Image.Image:
    return paragraph(rng, hand, rng.uniform(0.045, 0.08) * width, (width, height))


def _numbers(rng: np.random.Generator, hand: Hand, width: int, height: int) -> Image.Image:
    image, _ = _blank(width, height)
    laid(image, fitted(number(rng), hand, width * 0.8, height * 0.9), (width / 2, height / 2))
    return image


def _bar_code(rng: np.random.Generator, hand: Hand, width: int, height: int) -> Image.Image:
    """Bars of one to four modules, and digits below."""
    image, draw = _blank(width, height)
    modules = np.cumsum(rng.integers(1, 5, 60))
    modules = modules * (width * rng.uniform(0.5, 0.95) / modules[-1])
    left, digits = (width - modules[-1]) / 2, min(height * 0.25, width * 0.09)
    for low, high in zip(modules[:-1:2], modules[1::2], strict=False):
        draw.rectangle((left + low, 0, max(left + low, left + high - 1), height - digits), fill=INK)
    code = "".join(map(str, rng.integers(0, 10, 13)))
    laid(image, line(code, hand, digits), (width / 2, height - digits / 2))
    return image


def _table(rng: np.random.Generator, hand: Hand, width: int, height: int) -> Image.Image:
    """Rows of a word and a number between rules."""
    image, draw = _blank(width, height)
    rows = int(rng.integers(2, 7))
    step = height / rows
    thick = max(1, round(width * rng.uniform(0.003, 0.012)))
    for k in range(rows):
        middle = (k + 0.5) * step
        draw.line((0, k * step, width, k * step), fill=INK, width=thick)
        for text, right in ((word(rng, hand.script), False), (number(rng), True)):
            one = line(text, hand, step * 0.6)
            x = width - one.width / 2 - thick if right else one.width / 2 + thick
            laid(image, one, (x, middle))
    draw.rectangle((0, 0, width - 1, height - 1), outline=INK, width=thick)
    return image


def _picture(rng: np.random.Generator, hand: Hand, width: int, height: int) -> Image.Image:
    """An emblem, or two with a word between them."""
    image, _ = _blank(width, height)
    sign = emblem(rng, min(width, height))
    if rng.random() < 0.5 or width < 3 * height:
        laid(image, sign, (width / 2, height / 2))
    else:
        for x in (height / 2, width - height / 2):
            laid(image, sign, (x, height / 2))
        middle = fitted(phrase(rng, hand.script, 1), hand, width - 2.4 * height, height * 0.6)
        laid(image, middle, (width / 2, height / 2))
    return image


def _band(rng: np.random.Generator, hand: Hand, width: int, height: int) -> Image.Image:
    """A bar, a row of squares, waves of an ornament, or a block like a square code."""
    image, draw = _blank(width, height)
    style = int(rng.integers(3))
    if style == 0:
        draw.rectangle((0, height * 0.2, width, height * 0.8), fill=int(rng.integers(90, 256)))
    elif style == 1:
        cells = rng.random((16, 16)) < 0.5
        code = Image.fromarray(np.where(cells, INK, 0).astype(np.uint8))
        laid(
            image, code.resize((height, height), Image.Resampling.NEAREST), (width / 2, height / 2)
        )
    else:
        count = int(rng.integers(6, 24))
        step = width / count
        for k in range(count):
            box = (k * step, height * 0.3, (k + 0.6) * step, height * 0.3 + 0.6 * step)
            (draw.ellipse if count % 2 else draw.rectangle)(box, fill=INK)
    return image
