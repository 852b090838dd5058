"""Positions in a photo that a user has marked as highlights or paint."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..imaging.bounding_box import mask_diagonal

Place = tuple[float, float]
_REACH = 0.02  # of the object's diagonal
_LEAST_REACH = 2.0  # pixels


@dataclass(frozen=True)
class HighlightMarks:
    """Marks of a user, in pixels of the upright photo from its upper left corner.

    Attributes
    ----------
    highlights : tuple of (x, y)
        On highlights; the centre of pixel (3, 5) is (3.5, 5.5).
    paint : tuple of (x, y)
        On print or paint that looks like a highlight.
    """

    highlights: tuple[Place, ...] = ()
    paint: tuple[Place, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.highlights or self.paint)

    def scaled(self, factor: float) -> "HighlightMarks":
        """Return the marks of the photo resized by a factor.

        Parameters
        ----------
        factor : float

        Returns
        -------
        HighlightMarks
        """
        return self._changed(lambda x, y: (factor * x, factor * y))

    def moved(self, right: float, down: float) -> "HighlightMarks":
        """Return the marks in a frame that begins elsewhere.

        Parameters
        ----------
        right, down : float
            Position of this frame in the other one, pixels.

        Returns
        -------
        HighlightMarks
        """
        return self._changed(lambda x, y: (x + right, y + down))

    def _changed(self, change: Callable[[float, float], Place]) -> "HighlightMarks":
        """The marks with other places."""
        return HighlightMarks(
            *(tuple(change(*place) for place in places) for places in (self.highlights, self.paint))
        )

    def check(self, mask: np.ndarray) -> None:
        """Check that the marks lie on the object.

        Parameters
        ----------
        mask : (H, W) bool ndarray

        Raises
        ------
        InputError
            If one does not.
        """
        for x, y in (*self.highlights, *self.paint):
            row, column = int(np.floor(y)), int(np.floor(x))
            inside = 0 <= row < mask.shape[0] and 0 <= column < mask.shape[1]
            if not (inside and mask[row, column]):
                raise InputError(
                    f"the mark {column},{row} lies outside of the object: mark a pixel of it, "
                    "counted from 0 at the top left"
                )


def mark_radius(mask: np.ndarray) -> float:
    """Return the largest distance in pixels between a mark and its highlight.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        The object; not empty.

    Returns
    -------
    float
    """
    return max(_LEAST_REACH, _REACH * mask_diagonal(mask))
