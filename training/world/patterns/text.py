"""Printed text: headlines, small print, wallpapers of a word, single letters, columns.

Text is black print and large headlines alike, in many scripts, upright or turned, and cut off at
the edges of the map as on a body that shows a part of its print.
"""

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from .canvas import FINER, Painting, averaged
from .lettering import INK, draw_hand, fitted, laid, line, on_circle, paragraph
from .words import phrase, word

_ROOM = 1.5  # the canvas of letters is larger than the map, to be turned


def text(rng: np.random.Generator, side: int) -> Painting:
    """Draw printed text.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
        Ink is 1.
    """
    fine = FINER * side
    room = round(_ROOM * fine)
    canvas = Image.new("L", (room, room), 0)
    writers = (_headline, _small_print, _headline_and_print, _wallpaper, _letter, _circle)
    write = writers[int(rng.choice(len(writers), p=(0.25, 0.2, 0.25, 0.12, 0.1, 0.08)))]
    write(rng, canvas, fine)
    if rng.random() < 0.15:
        canvas = _shadowed(rng, canvas, fine)
    angle = rng.choice([0, rng.normal(0, 5), rng.uniform(-180, 180), 90, -90])
    if angle:
        canvas = canvas.rotate(float(angle), Image.Resampling.BICUBIC)
    edge = (room - fine) // 2
    cut = canvas.crop((edge, edge, edge + fine, edge + fine))
    return Painting(averaged(np.asarray(cut, float) / 255), False)


def _headline(rng: np.random.Generator, canvas: Image.Image, fine: int) -> None:
    """One to four large lines around the middle, one of them perhaps reversed out of a bar."""
    hand, middle = draw_hand(rng), canvas.width / 2
    width, count = fine * rng.uniform(0.6, 1.25), int(rng.integers(1, 5))
    lines = [
        fitted(phrase(rng, hand.script, int(rng.integers(1, 3))), hand, width, fine / count)
        for _ in range(count)
    ]
    gap = fine * rng.uniform(0.01, 0.06)
    top = middle - (sum(one.height for one in lines) + gap * (count - 1)) / 2
    reversed_line = int(rng.integers(count)) if rng.random() < 0.3 else -1
    for k, one in enumerate(lines):
        if k == reversed_line:
            one = _reversed_out(one, fine)
        laid(canvas, one, (middle, top + one.height / 2))
        top += one.height + gap


def _reversed_out(letters: Image.Image, fine: int) -> Image.Image:
    """Paper letters in a bar of ink."""
    margin = fine // 30
    bar = Image.new("L", (letters.width + 4 * margin, letters.height + 2 * margin), INK)
    bar.paste(0, (2 * margin, margin), letters)
    return bar


def _small_print(rng: np.random.Generator, canvas: Image.Image, fine: int) -> None:
    hand, size = draw_hand(rng), fine * np.exp(rng.uniform(np.log(0.045), np.log(0.13)))
    columns = int(rng.choice([1, 1, 1, 2]))
    wide = fine * rng.uniform(0.8, 1.4) / columns
    for k in range(columns):
        block = paragraph(rng, hand, size, (wide * 0.92, fine * rng.uniform(0.5, 1.4)))
        laid(canvas, block, (canvas.width / 2 + (k - (columns - 1) / 2) * wide, canvas.width / 2))


def _headline_and_print(rng: np.random.Generator, canvas: Image.Image, fine: int) -> None:
    """A name, a line below it, rules, small print."""
    hand, middle, width = draw_hand(rng), canvas.width / 2, fine * rng.uniform(0.6, 1.0)
    top = middle - fine * rng.uniform(0.3, 0.5)
    head = fitted(phrase(rng, hand.script, int(rng.integers(1, 3))), hand, width, fine * 0.5)
    laid(canvas, head, (middle, top + head.height / 2))
    top += head.height + fine * 0.05
    if rng.random() < 0.5:
        thick = fine * rng.uniform(0.008, 0.03)
        ImageDraw.Draw(canvas).rectangle(
            (middle - width / 2, top, middle + width / 2, top + thick), fill=INK
        )
        top += thick + fine * 0.04
    second = draw_hand(rng, hand.script) if rng.random() < 0.6 else hand
    sub = fitted(phrase(rng, hand.script, 3), second, width * rng.uniform(0.5, 1), fine * 0.15)
    laid(canvas, sub, (middle, top + sub.height / 2))
    top += sub.height + fine * 0.05
    size = fine * rng.uniform(0.04, 0.08)
    block = paragraph(rng, second, size, (width, max(size, middle + fine * 0.48 - top)))
    laid(canvas, block, (middle, top + block.height / 2))


def _wallpaper(rng: np.random.Generator, canvas: Image.Image, fine: int) -> None:
    """One word again and again, as on wrapping paper."""
    hand = draw_hand(rng)
    size = fine * rng.uniform(0.07, 0.25)
    one = line(phrase(rng, hand.script, 1), hand, size)
    across, down = one.width * rng.uniform(1.1, 1.8), one.height * rng.uniform(1.2, 2.5)
    shift = rng.choice([0, 0.5])
    for row, y in enumerate(np.arange(0, canvas.height, down)):
        for x in np.arange((row % 2) * shift * across - across, canvas.width + across, across):
            laid(canvas, one, (x, y))


def _letter(rng: np.random.Generator, canvas: Image.Image, fine: int) -> None:
    """A letter or number as large as the map."""
    hand = draw_hand(rng)
    sign = word(rng, hand.script)[: int(rng.integers(1, 3))].upper()
    x, y = canvas.width / 2 + fine * rng.normal(0, 0.1, 2)
    laid(canvas, line(sign, hand, fine * rng.uniform(0.6, 1.3)), (x, y))


def _circle(rng: np.random.Generator, canvas: Image.Image, fine: int) -> None:
    """Text around a middle, as on lids and caps."""
    hand = draw_hand(rng)
    size, radius = fine * rng.uniform(0.07, 0.14), fine * rng.uniform(0.25, 0.42)
    around = phrase(rng, hand.script, int(rng.integers(3, 7)))
    middle = (canvas.width / 2, canvas.width / 2)
    laid(canvas, on_circle(around, hand, size, radius, rng.uniform(-180, 180)), middle)
    inside = fitted(phrase(rng, hand.script, 1), hand, 1.2 * radius, 0.8 * radius)
    laid(canvas, inside, middle)


def _shadowed(rng: np.random.Generator, canvas: Image.Image, fine: int) -> Image.Image:
    """The letters above a paler copy of themselves, or with a pale rim."""
    if rng.random() < 0.5:
        step = round(fine * rng.uniform(0.01, 0.03))
        pale = Image.new("L", canvas.size, 0)
        pale.paste(canvas, (step, step))
    else:
        pale = canvas.filter(ImageFilter.MaxFilter(2 * round(fine / 80) + 1))
    level = rng.uniform(0.3, 0.7)
    below = pale.point([round(k * level) for k in range(256)])
    below.paste(INK, (0, 0), canvas)
    return below
