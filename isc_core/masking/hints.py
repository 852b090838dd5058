"""A user's hints: points on the object, points on the background, a box around the object."""

from dataclasses import dataclass

from ..errors import InputError
from ..photo.grabcut import Box, check_box

Point = tuple[int, int]


@dataclass(frozen=True)
class Hints:
    """Hints, in pixels of the upright photo from its top left corner.

    Attributes
    ----------
    points : tuple of (x, y)
        On the object.
    background : tuple of (x, y)
        On the background.
    box : tuple of int or None
        (x, y, width, height) around the object, which does not extend beyond it.
    """

    points: tuple[Point, ...] = ()
    background: tuple[Point, ...] = ()
    box: Box | None = None

    def __bool__(self) -> bool:
        return bool(self.points or self.background or self.box)

    def check(self, width: int, height: int) -> None:
        """Check the hints against a photo's size, and against each other.

        Parameters
        ----------
        width, height : int
            Of the photo.

        Raises
        ------
        InputError
            If a point or the box lies outside the photo, or they contradict each other.
        """
        for name, points in (("--point", self.points), ("--not", self.background)):
            for x, y in points:
                if not (0 <= x < width and 0 <= y < height):
                    raise InputError(
                        f"{name} {x},{y}: lies outside of the photo of {width} x {height} pixels: "
                        "count from 0 at the top left"
                    )
        for x, y in self.points:
            if (x, y) in self.background:
                raise InputError(
                    f"--point {x},{y} and --not {x},{y} contradict each other: leave one out"
                )
        if self.box is None:
            return
        check_box(self.box, width, height)
        left, top, wide, high = self.box
        for x, y in self.points:
            if not (left <= x < left + wide and top <= y < top + high):
                raise InputError(
                    f"--point {x},{y}: lies outside of --box {left},{top},{wide},{high}: the box "
                    "holds the whole object"
                )
