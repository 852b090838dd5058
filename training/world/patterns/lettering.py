"""Lines and blocks of letters as images, and how they are laid on a map.

An image of letters is of mode "L", 0 for paper and 255 for ink, and as large as its letters.

Limits: letters stand on straight lines or on circles; no perspective, which the body adds.
"""

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from .typefaces import Script, Typeface, draw_script, draw_typeface, has_sign, sized_font
from .words import phrase

INK = 255
# Opening a font takes long: letters are written in few sizes, and made smaller.
_SIZES = np.rint(8 * 1.35 ** np.arange(14)).astype(int)  # 8 to 396 pixels


@dataclass(frozen=True)
class Hand:
    """How letters are written.

    Attributes
    ----------
    face : Typeface
    script : Script
    weight : int
        0 to 4, where the font is variable.
    stroke : float
        Width of an added stroke, in ems.
    hollow : bool
        Only the outline of a letter is inked.
    spacing : float
        Added between letters, in ems.
    stretch : float
        Width over its usual one.
    """

    face: Typeface
    script: Script
    weight: int
    stroke: float
    hollow: bool
    spacing: float
    stretch: float


def draw_hand(rng: np.random.Generator, script: Script | None = None) -> Hand:
    """Draw a way to write.

    Parameters
    ----------
    rng : numpy.random.Generator
    script : Script, optional
        Any if not given.

    Returns
    -------
    Hand
    """
    script = draw_script(rng) if script is None else script
    hollow = bool(rng.random() < 0.06)
    # Letters of a script that joins them are not moved apart.
    apart = script in (Script.LATIN, Script.GREEK, Script.CYRILLIC) and rng.random() < 0.2
    return Hand(
        face=draw_typeface(rng, script),
        script=script,
        weight=int(rng.integers(5)),
        stroke=0.03 if hollow else float(rng.choice([0, 0, 0, 0.02, 0.05])),
        hollow=hollow,
        spacing=float(rng.uniform(0.05, 0.4)) if apart else 0.0,
        stretch=float(np.exp(rng.normal(0, 0.2))),
    )


def line(text: str, hand: Hand, size: float) -> Image.Image:
    """Write one line.

    Parameters
    ----------
    text : str
    hand : Hand
    size : float
        Pixels of an em.

    Returns
    -------
    Image.Image
        Without the letters that the font does not have.
    """
    known = "".join(letter for letter in text if has_sign(hand.face.path, letter)).strip()
    text = known or hand.script.value[0]
    em = int(_SIZES[min(np.searchsorted(_SIZES, size), len(_SIZES) - 1)])
    font = sized_font(hand.face.path, em, hand.weight if hand.face.variable else 0)
    stroke = round(hand.stroke * em)
    pieces = list(text) if hand.spacing else [text]
    steps = [font.getlength(piece) + hand.spacing * em for piece in pieces]
    left, top, right, bottom = font.getbbox(text, stroke_width=stroke)
    wide = max(sum(steps), right - left) + 2 * stroke + 2
    image = Image.new("L", (max(1, round(wide)), max(1, round(bottom - top) + 1)), 0)
    draw, x = ImageDraw.Draw(image), float(1 - left)
    for piece, step in zip(pieces, steps, strict=True):
        draw.text((x, -top), piece, font=font, fill=INK, stroke_width=stroke)
        x += step
    if hand.hollow and stroke:
        draw.text((1 - left, -top), text if not hand.spacing else "", font=font, fill=0)
    wanted = max(1, round(image.width * hand.stretch * size / em))
    return image.resize((wanted, max(1, round(image.height * size / em))), Image.Resampling.HAMMING)


def fitted(text: str, hand: Hand, width: float, most: float) -> Image.Image:
    """Write one line as wide as given.

    Parameters
    ----------
    text : str
    hand : Hand
    width : float
        Of the line, in pixels.
    most : float
        Largest em, in pixels.

    Returns
    -------
    Image.Image
        As wide as `width` or narrower.
    """
    trial = line(text, hand, 40)
    return line(text, hand, float(np.clip(40 * width / max(trial.width, 1), 5, most)))


def paragraph(
    rng: np.random.Generator, hand: Hand, size: float, box: tuple[float, float]
) -> Image.Image:
    """Fill a box with lines.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the words.
    hand : Hand
    size : float
        Pixels of an em.
    box : tuple of float
        Width and height.

    Returns
    -------
    Image.Image
        Lines that are too long are cut off.
    """
    width, height = max(1, round(box[0])), max(1, round(box[1]))
    image = Image.new("L", (width, height), 0)
    leading, align, top = size * rng.uniform(1.05, 1.7), float(rng.choice([0, 0, 0.5, 1])), 0.0
    count = max(1, round(width / (3.2 * size)))
    while top + size <= height:
        words = max(1, count - int(rng.integers(0, 3)))
        written = line(phrase(rng, hand.script, words), hand, size)
        image.paste(written, (round((width - written.width) * align), round(top)))
        top += leading * (2 if rng.random() < 0.08 else 1)
    return image


def on_circle(text: str, hand: Hand, size: float, radius: float, start: float) -> Image.Image:
    """Write along a circle, the letters' feet toward its middle.

    Parameters
    ----------
    text : str
    hand : Hand
    size : float
        Pixels of an em.
    radius : float
        Of the middle of the letters, in pixels.
    start : float
        Angle of the first letter, in degrees clockwise from the top.

    Returns
    -------
    Image.Image
        A square with the circle in its middle.
    """
    side = round(2 * (radius + size))
    whole, angle = Image.new("L", (side, side), 0), start
    for letter in text:
        written = line(letter, hand, size) if letter.strip() else None
        step = np.degrees((written.width if written else size / 2) / radius)
        if written:
            single = Image.new("L", (side, side), 0)
            middle = (round(side / 2 - written.width / 2), round(size - written.height / 2))
            single.paste(written, middle)
            turned = single.rotate(-(angle + step / 2), Image.Resampling.BICUBIC)
            whole.paste(INK, (0, 0), turned)
        angle += step * 1.12
        if angle - start > 340:
            break
    return whole


def laid(
    canvas: Image.Image, letters: Image.Image, middle: tuple[float, float], angle: float = 0
) -> None:
    """Ink letters on a map.

    Parameters
    ----------
    canvas : Image.Image
        Mode "L"; changed in place.
    letters : Image.Image
    middle : tuple of float
        Where the middle of the letters comes to lie, in pixels.
    angle : float
        Degrees, counter-clockwise.
    """
    if angle:
        letters = letters.rotate(angle, Image.Resampling.BICUBIC, expand=True)
    place = (round(middle[0] - letters.width / 2), round(middle[1] - letters.height / 2))
    canvas.paste(INK, place, letters)
