"""A printing plate: lines, shapes and words printed with one ink, without any font file (A. V.
Hershey's stroke letters).

Lengths are in heights of the texture: x from 0 to `ASPECT` once around, y from 0 at the top to 1. x
is periodic.

Citation: A. V. Hershey, "Calligraphy for computers", U.S. Naval Weapons Laboratory report 2101
(1967), which has no DOI.

Limits: Latin letters without accents; each drawn item is at most one turn wide.
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
_FINER = 2  # pixels of the plate per texel, in each direction
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
    """The print of one ink on a texture of `size` x `size` texels."""

    def __init__(self, size: int) -> None:
        self._size, self._scale = size, size * _FINER
        self._turn = round(ASPECT * self._scale)
        self._canvas = np.zeros((self._scale, 2 * self._turn), np.uint8)

    def cover(self) -> np.ndarray:
        """Return the ink coverage of each texel, (size, size) in [0, 1]."""
        once = np.maximum(self._canvas[:, : self._turn], self._canvas[:, self._turn :])
        return (
            cv2.resize(once, (self._size, self._size), interpolation=cv2.INTER_AREA).astype(float)
            / 255
        )

    def line(self, points: np.ndarray, width: float, closed: bool = False) -> None:
        """Draw a line through `points` (N, 2), x and y.

        Parameters
        ----------
        points : (N, 2) ndarray
            x and y.
        width : float
            Width of the line.
        closed : bool, optional
            Connect the last point with the first.
        """
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
        """Fill a polygon.

        Parameters
        ----------
        points : (N, 2) ndarray
            Corners, x and y.
        """
        cv2.fillPoly(self._canvas, [self._placed(points)], 255, cv2.LINE_AA, _SHIFT)

    def box(self, left: float, top: float, width: float, height: float, line: float = 0.0) -> None:
        """Draw a rectangle: filled, or its outline if the width `line` is above 0.

        Parameters
        ----------
        left, top, width, height : float
            The rectangle.
        line : float, optional
            Width of the outline, 0 for a filled rectangle.
        """
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
        """Write words on a baseline.

        Parameters
        ----------
        words : str
            The words.
        left, base : float
            Left end of the baseline.
        height : float
            Height of capital letters.
        face : int
            One of `FACES`.
        weight : float, optional
            Width of the strokes relative to `height`.
        """
        scale, stroke = self._letters(height, face, weight)
        place = round(np.mod(left, ASPECT) * self._scale), round(base * self._scale)
        cv2.putText(self._canvas, words, place, face, scale, 255, stroke, cv2.LINE_AA)

    def text_width(self, words: str, height: float, face: int, weight: float = 0.1) -> float:
        """Return the width of `text` with the same parameters.

        Parameters
        ----------
        words : str
            The words.
        height : float
            Height of capital letters.
        face : int
            One of `FACES`.
        weight : float, optional
            Width of the strokes relative to `height`.

        Returns
        -------
        float
            Width in heights of the texture.
        """
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
        """Write words centred on x = `middle`, reduced to fit into `room`.

        Parameters
        ----------
        words : str
            The words.
        middle, base : float
            Middle of the baseline.
        height : float
            Height of capital letters.
        face : int
            One of `FACES`.
        room : float
            Largest width.
        weight : float, optional
            Width of the strokes relative to the height.
        """
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
        """Points in OpenCV's format, shifted by whole turns so that they begin in the first one."""
        start = np.floor(points[:, 0].min() / ASPECT) * ASPECT
        return np.rint((points - (start, 0)) * self._scale * 2**_SHIFT).astype(np.int32)[:, None]


def word(rng: np.random.Generator) -> str:
    """Generate a random word of one to three syllables.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    str
        Lower-case letters.
    """
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
    """Write lines of random words, flush left; the last line of a paragraph is short.

    Parameters
    ----------
    plate : Plate
        Where to write.
    rng : numpy.random.Generator
        Random numbers.
    left, top, width : float
        Position and width of the lines.
    count : int
        Number of lines.
    height : float
        Height of capital letters.
    face : int
        One of `FACES`.
    """
    for number in range(count):
        base = top + (1 + 1.9 * number) * height
        room = width * (rng.uniform(0.2, 0.8) if rng.random() < 0.2 else 1)
        line, longer = "", word(rng).capitalize()
        while plate.text_width(longer, height, face) < room:
            line, longer = longer, f"{longer} {word(rng)}"
        plate.text(line, left, base, height, face)


def curve(controls: np.ndarray, count: int = 60) -> np.ndarray:
    """Return points on a cubic Bezier curve.

    Parameters
    ----------
    controls : (4, 2) ndarray
        Control points.
    count : int, optional
        Number of points.

    Returns
    -------
    (count, 2) ndarray
        The points.
    """
    t = np.linspace(0, 1, count)[:, None]
    weights = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    return weights @ controls
