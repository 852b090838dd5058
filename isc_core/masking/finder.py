"""Masks for the reader of photos: found, or refused with a remedy."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..io.decoders import Raster, read_raster
from ..io.limits import DEFAULT_LIMITS, Limits
from ..networks.mask_network import Count
from ..photo.found_mask import FoundMask
from ..photo.masks import MIN_MASK_PIXELS, check_mask
from ..photo.photo import Photo
from ..photo.reading import photo_from_raster
from .hints import Hints
from .search import find_mask, find_masks, separate_parts

LEAST_CONFIDENCE = 0.3  # least confidence of a mask that is used without being asked for
_LIKELY = 0.5  # the same where the whole photo would do as well
_SEVERAL = 0.3  # of the largest part: a second one as large is another object
_REMEDY = "mark it with --box x,y,width,height or --point x,y, or give a mask with --mask"


@dataclass(frozen=True)
class MaskSearch:
    """A `photo.found_mask.MaskFinder` that asks the network.

    Attributes
    ----------
    hints : Hints
        Where to look. With hints, alpha channels and black borders are not used.
    lenient : bool
        Return None instead of refusing, and of a mask that is rather wrong than right.
    """

    hints: Hints = field(default_factory=Hints)
    lenient: bool = False

    @property
    def always(self) -> bool:
        """Whether to look even where the photo has an alpha channel or a black border."""
        return bool(self.hints)

    def __call__(self, name: str, light: np.ndarray) -> FoundMask | None:
        """Find the mask of a photo.

        Parameters
        ----------
        name : str
            Opens the error message.
        light : (H, W, 3) float32 ndarray
            Linear, 1 is white.

        Returns
        -------
        FoundMask or None
            None: it is not sure, and lenient.

        Raises
        ------
        InputError
            If it is not sure, or the hints do not fit.
        """
        self.hints.check(light.shape[1], light.shape[0])
        found = find_mask(light, self.hints)
        problem = why_refused(found, self.hints, _LIKELY if self.lenient else LEAST_CONFIDENCE)
        if not problem:
            return found
        if self.lenient and not self.hints:
            return None
        raise InputError(f"{name}: {problem}")


def why_refused(
    found: FoundMask, hints: Hints | None = None, least: float = LEAST_CONFIDENCE
) -> str:
    """Return why a mask is not used.

    Parameters
    ----------
    found : FoundMask
    hints : Hints, optional
        With them a mask need not be sure.
    least : float, optional
        Confidence of a mask that is used.

    Returns
    -------
    str
        What is wrong and what to do; "" if the mask is used.
    """
    enough = int(found.mask.sum()) >= MIN_MASK_PIXELS
    if hints:
        return "" if enough else "no object found there: put --point on it, or --box around it"
    several = enough and is_apart(found.mask)
    if enough and found.confidence >= least and not several:
        return ""
    kind = Count(int(found.counts.argmax()))
    if several or kind == Count.SEVERAL:
        return f"it seems to show several objects: {_REMEDY}; --each processes each of them"
    if kind == Count.NONE or not enough:
        return f"no distinct object found: {_REMEDY}"
    return f"its mask is uncertain (confidence {found.confidence:.0%}): {_REMEDY}"


def is_apart(mask: np.ndarray) -> bool:
    """Return whether a mask shows several objects.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        Not empty.

    Returns
    -------
    bool
        Its second part is about as large as its first.
    """
    return len(separate_parts(mask, _SEVERAL)) > 1


class EachSearch:
    """A `photo.found_mask.MaskFinder` that keeps the mask of each of several objects.

    Attributes
    ----------
    found : list of FoundMask
        From left to right.
    """

    always = False

    def __init__(self) -> None:
        self.found: list[FoundMask] = []

    def __call__(self, name: str, light: np.ndarray) -> FoundMask:
        """Find all objects of a photo.

        Parameters
        ----------
        name : str
            Opens the error message.
        light : (H, W, 3) float32 ndarray
            Linear, 1 is white.

        Returns
        -------
        FoundMask
            All of them together.

        Raises
        ------
        InputError
            If there is none.
        """
        self.found = [one for one in find_masks(light) if int(one.mask.sum()) >= MIN_MASK_PIXELS]
        if not self.found:
            raise InputError(f"{name}: no distinct objects found: {_REMEDY}")
        cover = np.max([one.cover for one in self.found], axis=0)
        least = min(self.found, key=lambda one: one.confidence)
        return replace(least, cover=cover)


def read_each(
    path: Path, mask_path: Path | None, transfer: str = "auto", limits: Limits = DEFAULT_LIMITS
) -> list[Photo]:
    """Read a photo of several separate objects.

    Parameters
    ----------
    path : Path
    mask_path : Path or None
        A mask of all of them.
    transfer : {"auto", "srgb", "linear"}
    limits : Limits

    Returns
    -------
    list of Photo
        One for each object, from left to right.

    Raises
    ------
    InputError
        If anything cannot be used.
    """
    raster = read_raster(path, limits)
    mask = None if mask_path is None else read_raster(mask_path, limits)
    return photos_of_each(raster, str(path), mask, str(mask_path), transfer)


def photos_of_each(
    raster: Raster, name: str, mask: Raster | None, mask_name: str, transfer: str
) -> list[Photo]:
    """Make one photo for each separate object of decoded files.

    Parameters
    ----------
    raster : Raster
        The photo.
    name : str
        Opens the error messages.
    mask : Raster or None
        A mask of all objects.
    mask_name : str
    transfer : {"auto", "srgb", "linear"}

    Returns
    -------
    list of Photo
        From left to right.

    Raises
    ------
    InputError
        If anything cannot be used.
    """
    search = EachSearch()
    photo = photo_from_raster(raster, name, mask, mask_name, transfer=transfer, finder=search)
    if not search.found:
        photos = [replace(photo, mask=part) for part in separate_parts(photo.mask)]
    else:
        photos = [_alone(photo, one) for one in search.found]
    for number, one in enumerate(photos, 1):
        check_mask(one.mask, f"{name}: the mask of object {number}")
    return photos


def _alone(photo: Photo, found: FoundMask) -> Photo:
    original = replace(photo.original, mask_from="each", confidence=None)
    return replace(photo, mask=found.mask, original=original, found=found, cover=found.cover)
