"""A mask that was found in a photo, and the interface of its finder."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

FOUND = ("automatic", "hints", "each")  # their values of `PhotoSource.mask_from`


@dataclass(frozen=True, eq=False)
class FoundMask:
    """A mask that was found.

    Attributes
    ----------
    cover : (H, W) float32 ndarray
        Fraction of each pixel that the object covers.
    confidence : float
        The probability that the overlap (IoU) with the intended object is at least .5.
    counts : (3,) ndarray
        Probabilities that the photo shows none, one and several objects.
    features : (N,) ndarray
        Features from which the confidence was computed, see `masking.confidence`.
    """

    cover: np.ndarray
    confidence: float
    counts: np.ndarray
    features: np.ndarray

    @property
    def mask(self) -> np.ndarray:
        """The pixels (H, W) at least half covered by the object."""
        return self.cover >= 0.5


class MaskFinder(Protocol):
    """Finds the mask of a photo by appearance."""

    @property
    def always(self) -> bool:
        """Whether to search even where the photo has an alpha channel or a black border."""

    def __call__(self, name: str, light: np.ndarray) -> FoundMask | None:
        """Find the mask of a photo.

        Parameters
        ----------
        name : str
            Prefix of the error message.
        light : (H, W, 3) float32 ndarray
            Linear, 1 is white.

        Returns
        -------
        FoundMask or None
            None: the confidence is too low; the whole frame may be used.

        Raises
        ------
        InputError
            If the confidence is too low.
        """
