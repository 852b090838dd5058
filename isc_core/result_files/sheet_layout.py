"""The layout of a contact sheet: a title, and panels on cards with their labels."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..imaging.srgb import srgb_codes, srgb_to_linear
from ..io.printable_names import readable
from .panels import SIDE, Panel

_GAP, _EDGE, _LABEL, _HEAD = 20, 40, 38, 104  # pixels
_PAGE, _CARD, _TEXT, _FAINT = (20, 21, 23), (33, 35, 38), (238, 238, 236), (150, 153, 158)  # sRGB
_KEY = 10  # pixels: side of a key's square
_RADIUS = 12  # pixels: of the cards' round corners


def sheet_of(title: str, subtitle: str, panels: Sequence[Panel], columns: int) -> Image.Image:
    """Draw a sheet.

    Parameters
    ----------
    title, subtitle : str
        Cut to the width of the sheet.
    panels : sequence of Panel
        Row by row.
    columns : int

    Returns
    -------
    PIL.Image.Image
    """
    rows = -(-len(panels) // columns)
    width = 2 * _EDGE + columns * SIDE + (columns - 1) * _GAP
    height = _HEAD + rows * (SIDE + _LABEL) + (rows - 1) * _GAP + _EDGE
    sheet = Image.new("RGB", (width, height), _PAGE)
    draw = ImageDraw.Draw(sheet)
    _write(draw, (_EDGE, 50), title, 30, _TEXT, width - 2 * _EDGE)
    _write(draw, (_EDGE, 80), subtitle, 16, _FAINT, width - 2 * _EDGE)
    card = _rounded()
    with ThreadPoolExecutor(2) as pool:
        pictures = list(pool.map(_picture, panels))
    for index, (panel, picture) in enumerate(zip(panels, pictures, strict=True)):
        row, column = divmod(index, columns)
        x, y = _EDGE + column * (SIDE + _GAP), _HEAD + row * (SIDE + _LABEL + _GAP)
        sheet.paste(picture, (x, y), card)
        end = _write(draw, (x + 2, y + SIDE + 27), panel.label, 18, _TEXT, SIDE)
        right = _write_keys(draw, (x + SIDE - 2, y + SIDE + 27), panel.keys)
        _write(draw, (right, y + SIDE + 27), panel.remark, 14, _FAINT, right - end - 10, right=True)
    return sheet


def _write_keys(
    draw: ImageDraw.ImageDraw,
    place: tuple[float, float],
    keys: Sequence[tuple[str, tuple[int, int, int]]],
) -> float:
    """Draw a legend of coloured squares and texts, right-aligned at `place`; return its left."""
    right, baseline = place
    font = _font(14)
    for text, color in reversed(keys):
        draw.text((right, baseline), text, fill=_FAINT, font=font, anchor="rs")
        right -= font.getlength(text) + 4
        draw.rectangle((right - _KEY, baseline - _KEY, right, baseline), fill=color)
        right -= _KEY + 8
    return right


def _write(
    draw: ImageDraw.ImageDraw,
    place: tuple[float, float],
    text: str,
    size: int,
    color: tuple[int, int, int],
    room: float,
    *,
    right: bool = False,
) -> float:
    """Draw a line of text at the baseline `place`, cut to `room` pixels; return its end."""
    font, text = _font(size), readable(text)
    if font.getlength(text) > room:
        while text and font.getlength(text + "…") > room:
            text = text[:-1]
        text += "…"
    draw.text(place, text, fill=color, font=font, anchor="rs" if right else "ls")
    return place[0] + font.getlength(text)


@cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def _picture(panel: Panel) -> Image.Image:
    """The panel on its card, blended in linear light."""
    covered = np.flatnonzero(panel.coverage)  # elsewhere only the card is visible
    alpha = panel.coverage.ravel().take(covered).astype(np.float32)
    rest, planes = 1 - alpha, []
    for channel, card in enumerate(_CARD):
        linear = panel.color[..., channel].ravel().take(covered).astype(np.float32)
        np.clip(linear, 0, 1, out=linear)
        linear *= alpha
        linear += rest * np.float32(srgb_to_linear(card / 255.0))
        plane = np.full(panel.coverage.shape, card, np.uint8)
        plane.reshape(-1)[covered] = srgb_codes(linear)
        planes.append(plane)
    return Image.fromarray(np.stack(planes, -1))


def _rounded() -> Image.Image:
    """The coverage of the card, with antialiased round corners taken from a small card."""
    half = 2 * _RADIUS
    drawn = Image.new("L", (8 * half, 8 * half), 0)
    box = (0, 0, 8 * half - 1, 8 * half - 1)
    ImageDraw.Draw(drawn).rounded_rectangle(box, 4 * _RADIUS, fill=255)
    small = drawn.resize((2 * half, 2 * half), Image.Resampling.LANCZOS)
    shape = Image.new("L", (SIDE, SIDE), 255)
    for x, left in ((0, 0), (half, SIDE - half)):
        for y, top in ((0, 0), (half, SIDE - half)):
            shape.paste(small.crop((x, y, x + half, y + half)), (left, top))
    return shape
