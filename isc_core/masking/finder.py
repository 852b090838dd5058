"""Mask finders for the reader of photos.

Problem: a photo without a mask is either masked, or refused with a message that says what to do. A
wrong mask spoils everything that follows.

Method: a mask is found (`search`) and used unless there is a reason not to (`refusal`). Both are
imported when they are needed: most photos have a mask, or a black border.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..filters.distance import nearest_pixels
from ..io.decoders import Raster, read_raster
from ..io.limits import DEFAULT_LIMITS, Limits
from ..photo.found_mask import FoundMask
from ..photo.masks import MIN_MASK_PIXELS, mask_problem
from ..photo.photo import Photo
from ..photo.reading import constant_problem, photo_from_raster
from .components import connected_components
from .hints import Hints

_MIN_LENIENT_CONFIDENCE = 0.5  # the same if the whole photo can be used instead


@dataclass(frozen=True)
class MaskSearch:
    """A `photo.found_mask.MaskFinder` that uses the network.

    Attributes
    ----------
    hints : Hints
        With hints, alpha channels and black borders are not used.
    lenient : bool
        Without hints, return None instead of refusing, and require a higher confidence.
    """

    hints: Hints = field(default_factory=Hints)
    lenient: bool = False

    @property
    def always(self) -> bool:
        """Whether to search even where the photo has an alpha channel or a black border."""
        return bool(self.hints)

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
            None: the mask is refused, and `lenient`.

        Raises
        ------
        InputError
            If the mask is refused, or the hints do not match the photo.
        """
        from .refusal import MIN_CONFIDENCE, refusal_reason
        from .search import find_mask

        self.hints.check(light.shape[1], light.shape[0])
        found = find_mask(light, self.hints)
        problem = refusal_reason(
            found, self.hints, _MIN_LENIENT_CONFIDENCE if self.lenient else MIN_CONFIDENCE
        )
        if not problem:
            return found
        if self.lenient and not self.hints:
            return None
        raise InputError(f"{name}: {problem}")


class EachObjectSearch:
    """A `photo.found_mask.MaskFinder` that finds each of several separate objects.

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
            Prefix of the error message.
        light : (H, W, 3) float32 ndarray
            Linear, 1 is white.

        Returns
        -------
        FoundMask
            The union of all masks, with the lowest of their confidences.

        Raises
        ------
        InputError
            If there is none.
        """
        from .refusal import REMEDY
        from .search import find_masks

        self.found = [one for one in find_masks(light) if int(one.mask.sum()) >= MIN_MASK_PIXELS]
        if not self.found:
            raise InputError(f"{name}: no distinct objects found: {REMEDY}")
        cover = np.max([one.cover for one in self.found], axis=0)
        least_certain = min(self.found, key=lambda one: one.confidence)
        return replace(least_certain, cover=cover)


def read_each_object(
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
        One for each object, from left to right. One that cannot be decomposed has a `problem`.

    Raises
    ------
    InputError
        If a file cannot be used, or there is no object.
    """
    raster = read_raster(path, limits)
    mask = None if mask_path is None else read_raster(mask_path, limits)
    return photos_of_each_object(raster, str(path), mask, str(mask_path), transfer)


def photos_of_each_object(
    raster: Raster, name: str, mask: Raster | None, mask_name: str, transfer: str
) -> list[Photo]:
    """Make one photo of each separate object from decoded files.

    Parameters
    ----------
    raster : Raster
        The photo.
    name : str
        Prefix of the error messages.
    mask : Raster or None
        A mask of all objects.
    mask_name : str
    transfer : {"auto", "srgb", "linear"}

    Returns
    -------
    list of Photo
        From left to right. One that cannot be decomposed has a `problem`.

    Raises
    ------
    InputError
        If a file cannot be used, or there is no object.
    """
    search = EachObjectSearch()
    photo = photo_from_raster(raster, name, mask, mask_name, transfer=transfer, finder=search)
    if not search.found:
        photos = _components_of(photo)
    else:
        photos = [_photo_of(photo, one) for one in search.found]
    inside = f"{name}: every pixel inside the mask"
    return [
        replace(
            one,
            original=replace(one.original, object_number=number),
            problem=mask_problem(one.mask, f"{name}: the mask of object {number}")
            or constant_problem(raster.values, inside, one.mask),
        )
        for number, one in enumerate(photos, 1)
    ]


def _components_of(photo: Photo) -> list[Photo]:
    """One photo of each component of the mask, with the coverage of that object alone."""
    components = connected_components(photo.mask)
    if len(components) == 1:
        return [replace(photo, mask=components[0])]
    # With an alpha channel, the colours of its rim are the object's own, which its name says.
    source = photo.original
    if source.mask_from != "alpha":
        source = replace(source, mask_from="each")
    rows, columns = nearest_pixels(photo.mask)
    cover = photo.mask.astype(np.float32) if photo.cover is None else photo.cover
    return [
        replace(
            photo,
            mask=component,
            original=source,
            cover=np.where(component[rows, columns], cover, np.float32(0)),
        )
        for component in components
    ]


def _photo_of(photo: Photo, found: FoundMask) -> Photo:
    original = replace(photo.original, mask_from="each", confidence=None)
    return replace(photo, mask=found.mask, original=original, found=found, cover=found.cover)
