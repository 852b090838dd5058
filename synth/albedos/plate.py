"""A printing plate: lines, shapes and words that one ink prints, without any font file (strokes of
A. V. Hershey's letters).

Lengths are heights of the texture: x from 0 to `ASPECT` once around, y from 0 at the top to 1. What
leaves at the right enters at the left.

Citation: A. V. Hershey, "Calligraphy for computers", U.S. Naval Weapons Laboratory report 2101
(1967), which has no DOI.

Limits: Latin letters without accents; each thing drawn is at most once around wide.
"""

import cv2
import numpy as np

from .fields import ASPECT

FACES: tuple[int, ...] = (
    cv2.FONT_HERSHEY_SIMPLEX,
    cv2.FONT_HERSHEY_DUPLEX,
    cv2.FONT_HERSHEY_COMPLEX,
    cv2.FONT_HERSHEY_TRIPLEX,
    cv2.FONT_HERSHEY_SCRIPT_COMPLEX,
)
_FINER = 2  # pixels of the plate a texel, each way
_SHIFT = 4  # binary places of a coordinate
_ONSETS = [
    "b",
    "c",
    "d",
    "f",
    "g",
    "h",
    "k",
    "l",
    "m",
    "n",
    "p",
    "r",
    "s",
    "t",
    "v",
    "br",
    "ch",
    "gr",
    "pl",
    "st",
    "tr",
]
_VOWELS = ["a", "e", "i", "o", "u", "ea", "io", "ou"]
_CODAS = ["", "", "l", "n", "r", "s", "t", "nd", "rk"]


class Plate:
    """One ink's print on a texture of `size` texels a side."""

    def __init__(self, size: int) -> None:
        self._size, self._scale = size, size * _FINER
        self._turn = round(ASPECT * self._scale)
        self._canvas = np.zeros((self._scale, 2 * self._turn), np.uint8)

    def cover(self) -> np.ndarray:
        """(size, size) float in [0, 1]: how much of each texel is inked."""
        once = np.maximum(self._canvas[:, : self._turn], self._canvas[:, self._turn :])
        return (
            cv2.resize(once, (self._size, self._size), interpolation=cv2.INTER_AREA).astype(float)
            / 255
        )

    def line(self, points: np.ndarray, width: float, closed: bool = False) -> None:
        """A line through `points` (N, 2), x and y."""
        cv2.polylines(
            self._canvas,
            [self._placed(points)],
            closed,
            255,
            max(1, round(width * self._scale)),
            cv2.LINE_AA,
            _SHIFT,
        )

    def area(self, points: np.ndarray) -> None:
        """The inside of the polygon `points` (N, 2), x and y."""
        cv2.fillPoly(self._canvas, [self._placed(points)], 255, cv2.LINE_AA, _SHIFT)

    def box(self, left: float, top: float, width: float, height: float, line: float = 0.0) -> None:
        """A rectangle: full, or its outline where `line`, the width of it, is above 0."""
        corners = np.array(
            [(left, top), (left + width, top), (left + width, top + height), (left, top + height)]
        )
        if line:
            self.line(corners, line, closed=True)
        else:
            self.area(corners)

    def text(
        self, words: str, left: float, base: float, height: float, face: int, weight: float = 0.1
    ) -> None:
        """Writes `words` from `left` on the line `base`; capitals are `height` high, strokes
        `weight` of that wide.
        """
        scale, stroke = self._letters(height, face, weight)
        place = round(np.mod(left, ASPECT) * self._scale), round(base * self._scale)
        cv2.putText(self._canvas, words, place, face, scale, 255, stroke, cv2.LINE_AA)

    def text_width(self, words: str, height: float, face: int, weight: float = 0.1) -> float:
        """How long `text` would make these words."""
        scale, stroke = self._letters(height, face, weight)
        return cv2.getTextSize(words, face, scale, stroke)[0][0] / self._scale

    def centred(
        self,
        words: str,
        middle: float,
        base: float,
        height: float,
        face: int,
        room: float,
        weight: float = 0.1,
    ) -> None:
        """Writes `words` around x = `middle`, smaller where they would be wider than `room`."""
        height *= min(1.0, room / self.text_width(words, height, face, weight))
        self.text(
            words,
            middle - self.text_width(words, height, face, weight) / 2,
            base,
            height,
            face,
            weight,
        )

    def _letters(self, height: float, face: int, weight: float) -> tuple[float, int]:
        pixels = height * self._scale
        stroke = max(1, round(weight * pixels))
        return cv2.getFontScaleFromHeight(face, max(2, round(pixels)), stroke), stroke

    def _placed(self, points: np.ndarray) -> np.ndarray:
        """Points as OpenCV takes them, moved by whole turns so that they begin in the first one."""
        start = np.floor(points[:, 0].min() / ASPECT) * ASPECT
        return np.rint((points - (start, 0)) * self._scale * 2**_SHIFT).astype(np.int32)[:, None]


def word(rng: np.random.Generator) -> str:
    """A word of one to three syllables that means nothing."""
    count = int(rng.integers(1, 4))
    return "".join(
        str(rng.choice(part)) for _ in range(count) for part in (_ONSETS, _VOWELS, _CODAS)
    )


def write_lines(
    plate: Plate,
    rng: np.random.Generator,
    left: float,
    top: float,
    width: float,
    count: int,
    height: float,
    face: int,
) -> None:
    """`count` lines of words, flush left, `width` wide, letters `height` high; the last line of a
    paragraph is short.
    """
    for number in range(count):
        base = top + (1 + 1.9 * number) * height
        room = width * (rng.uniform(0.2, 0.8) if rng.random() < 0.2 else 1)
        line, longer = "", word(rng).capitalize()
        while plate.text_width(longer, height, face) < room:
            line, longer = longer, f"{longer} {word(rng)}"
        plate.text(line, left, base, height, face)


def curve(controls: np.ndarray, count: int = 60) -> np.ndarray:
    """(count, 2): the cubic Bezier curve of four control points (4, 2)."""
    t = np.linspace(0, 1, count)[:, None]
    weights = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    return weights @ controls
