"""Simple plots as PNG: axes with ticks, lines, dots and bars, drawn with Pillow alone."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

COLOURS = ("#1b6ca8", "#d1495b", "#2e8b57", "#e09f3e", "#6a4c93")
_LEFT, _RIGHT, _TOP, _BOTTOM = 74, 16, 34, 48
_FINE = 2  # drawn this much larger, then shrunk: smooth edges


class Plot:
    """One pair of axes, 640 by 400 pixels. x in [x0, x1] to the right, y in [y0, y1] upward."""

    def __init__(
        self,
        title: str,
        x_name: str,
        y_name: str,
        x_range: tuple[float, float],
        y_range: tuple[float, float],
    ) -> None:
        self._x, self._y = x_range, y_range
        self._size = (640 * _FINE, 400 * _FINE)
        self._image = Image.new("RGB", self._size, "white")
        self._draw = ImageDraw.Draw(self._image)
        self._entries = 0
        self._axes(title, x_name, y_name)

    def line(self, x: np.ndarray, y: np.ndarray, colour: str, label: str = "") -> None:
        """A line through the points, and its entry in the legend."""
        self._draw.line(self._pixels(x, y), fill=colour, width=2 * _FINE, joint="curve")
        self._legend(label, colour)

    def dots(self, x: np.ndarray, y: np.ndarray, colour: str, label: str = "") -> None:
        """Single points, one pixel of the picture large."""
        for column, row in self._pixels(x, y):
            self._draw.rectangle([column, row, column + _FINE - 1, row + _FINE - 1], fill=colour)
        self._legend(label, colour)

    def bars(self, edges: np.ndarray, heights: np.ndarray, colour: str, label: str = "") -> None:
        """The outline of a histogram: `heights` (n,) between `edges` (n + 1,)."""
        self.line(
            np.repeat(edges, 2),
            np.concatenate([[self._y[0]], np.repeat(heights, 2), [self._y[0]]]),
            colour,
            label,
        )

    def save(self, path: Path) -> None:
        """Writes the PNG."""
        self._image.resize(
            (self._size[0] // _FINE, self._size[1] // _FINE), Image.Resampling.LANCZOS
        ).quantize(128).save(path, optimize=True)

    def _pixels(self, x: np.ndarray, y: np.ndarray) -> list[tuple[float, float]]:
        width, height = (
            self._size[0] - (_LEFT + _RIGHT) * _FINE,
            self._size[1] - (_TOP + _BOTTOM) * _FINE,
        )
        across = (np.asarray(x) - self._x[0]) / (self._x[1] - self._x[0])
        up = np.clip((np.asarray(y) - self._y[0]) / (self._y[1] - self._y[0]), 0, 1)
        columns = _LEFT * _FINE + across * width
        rows = _TOP * _FINE + (1 - up) * height
        return list(zip(columns.tolist(), rows.tolist(), strict=True))

    def _axes(self, title: str, x_name: str, y_name: str) -> None:
        for k in range(6):
            x, y = (low + (high - low) * k / 5 for low, high in (self._x, self._y))
            (left, low), (right, high) = self._pixels(np.array(self._x), np.array(self._y))
            ((column, row),) = self._pixels(np.array([x]), np.array([y]))
            self._draw.line(
                [(column, low), (column, high)], fill="#e4e4e4" if k else "#444444", width=_FINE
            )
            self._draw.line(
                [(left, row), (right, row)], fill="#e4e4e4" if k else "#444444", width=_FINE
            )
            self._text((column, low + 6 * _FINE), f"{x:.5g}", "mt")
            self._text((left - 6 * _FINE, row), f"{y:.5g}", "rm")
        self._text((self._size[0] / 2, 10 * _FINE), title, "mt", 15)
        self._text((self._size[0] / 2, self._size[1] - 8 * _FINE), x_name, "mb")
        name = Image.new("L", (300 * _FINE, 16 * _FINE))
        ImageDraw.Draw(name).text(
            (150 * _FINE, 2 * _FINE),
            y_name,
            fill=255,
            font=ImageFont.load_default(12 * _FINE),
            anchor="mt",
        )
        turned = name.rotate(90, expand=True)
        self._image.paste("#222222", (2 * _FINE, (self._size[1] - turned.height) // 2), turned)

    def _legend(self, label: str, colour: str) -> None:
        if label:
            row = (_TOP + 10 + 17 * self._entries) * _FINE
            self._text((self._size[0] - (_RIGHT + 8) * _FINE, row), label, "rm", 12, colour)
            self._entries += 1

    def _text(
        self,
        at: tuple[float, float],
        text: str,
        anchor: str,
        size: int = 12,
        colour: str = "#222222",
    ) -> None:
        self._draw.text(
            at, text, fill=colour, font=ImageFont.load_default(size * _FINE), anchor=anchor
        )
