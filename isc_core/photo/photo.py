"""A photo of one object: linear light and a mask, and their source."""

from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError
from ..imaging.area_resize import AreaFilter, resize_separately
from ..imaging.bounding_box import FramePart, mask_box
from ..io.decoders import MIN_SIDE
from ..io.reading_notes import ReadingNote
from .camera import Camera
from .found_mask import FoundMask
from .highlight_marks import HighlightMarks


@dataclass(frozen=True)
class PhotoSource:
    """The file of a photo.

    Attributes
    ----------
    sha256 : str
        Of the file.
    size : tuple of int
        (width, height), after rotation.
    bit_depth : int
        Bits per channel.
    transfer : str
        The transfer curve used: "srgb", "linear", or "profile" for that of the file's colour
        profile.
    mask_from : str
        "file", "alpha", "black border", "automatic", "hints", "each" or "whole frame".
    colour_profile : str
        Name of the colour space that the file states, "" without one.
    notes : tuple of ReadingNote
        Assumptions, and omissions.
    cropped : bool
        The metadata give a focal length, but for a frame of another aspect ratio: it is not valid.
    confidence : float or None
        Of a mask that was found automatically or by hints, see `FoundMask`.
    object_number : int
        Of one of several objects of the photo, from 1; 0 if the photo is of one object.
    """

    sha256: str
    size: tuple[int, int]
    bit_depth: int
    transfer: str
    mask_from: str
    colour_profile: str = ""
    notes: tuple[ReadingNote, ...] = ()
    cropped: bool = False
    confidence: float | None = None
    object_number: int = 0


@dataclass(frozen=True, eq=False)
class Photo:
    """One photo of an object.

    Attributes
    ----------
    image : (H, W, 3) float32 ndarray
        Linear Rec.709, finite and not negative; a grey file has three equal channels.
    mask : (H, W) bool ndarray
        The object. Its pixels may have channels that are zero.
    code_value : float
        Smallest step of the file's coding near black, in linear light: `srgb_to_linear(1/255)` for
        8-bit sRGB and other curves, 1/65535 for 16-bit linear. Floats have no such step: 2^-14 of
        the object's white (its 99.9th percentile), the step of a 14-bit sensor, so that the
        exposure of a file does not matter. Zero channels are floored at half of it, in logarithms
        only.
    clipped : (H, W) bool ndarray
        Some channel is at the coding's maximum, or the sensor was saturated, so the light may have
        been brighter; in float files: it was brighter than `white`. After resizing: part of the
        pixel is clipped.
    original : PhotoSource
        The file.
    scale : float
        Working size over original size; a working pixel coordinate is `scale` times the original
        one.
    exposed : bool
        Whether values are relative to white, which is 1: true for codes, unknown for floats.
    camera : Camera or None
        The pinhole camera of `image`; None where it is unknown, and the view is orthographic.
    found : FoundMask or None
        The mask at the file's size, if it was found automatically or from hints.
    cover : (H', W') float32 ndarray or None
        Coverage of the file's pixels by the object; None where all are 0 or 1, as in `mask`.
    marks : HighlightMarks
        Highlights and paint marked by the user.
    problem : str
        Why the object, one of several in a photo, cannot be decomposed; "" if it can.
    """

    image: np.ndarray
    mask: np.ndarray
    code_value: float
    clipped: np.ndarray
    original: PhotoSource
    scale: float = 1.0
    exposed: bool = True
    camera: Camera | None = None
    found: FoundMask | None = None
    cover: np.ndarray | None = None
    marks: HighlightMarks = field(default_factory=HighlightMarks)
    problem: str = ""

    @property
    def box(self) -> tuple[int, int, int, int]:
        """(x, y, width, height) of the mask's bounding box, in pixels of `image`."""
        return mask_box(self.mask)

    def cut(self, part: FramePart) -> "Photo":
        """Return a part of the photo, without the coverage of the file's pixels.

        Parameters
        ----------
        part : FramePart

        Returns
        -------
        Photo
        """
        x, y = part.corner
        return replace(
            self,
            image=part.cut(self.image),
            mask=part.cut(self.mask),
            clipped=part.cut(self.clipped),
            camera=None if self.camera is None else self.camera.moved(-x, -y),
            found=None,
            cover=None,
            marks=self.marks.moved(-x, -y),
        )

    def resized_to_object(self, max_size: int = 512, largest: float = 1.0) -> "Photo":
        """Downscale the photo to an object of at most `max_size` pixels.

        Linear light is averaged over the area of each new pixel, separately for object and
        background; the mask consists of the pixels at least half covered by the object.

        Parameters
        ----------
        max_size : int
            Long side of the mask's bounding box; 0 keeps the size. Photos are never enlarged.
        largest : float, optional
            Largest factor by which the photo may be resized, if it is too long.

        Returns
        -------
        Photo

        Raises
        ------
        InputError
            If `max_size` is negative or leaves the object thinner than 8 pixels.
        """
        if max_size < 0:
            raise InputError(
                f"--max-size {max_size}: give the long side of the object in pixels, or 0 to keep "
                "the photo's size"
            )
        longest = max(self.box[2:])
        if max_size == 0 or longest <= max_size:
            return self
        factor = min(max_size / longest, largest)
        while True:
            area = AreaFilter.of(self.mask.shape, factor)
            cover = area(self.mask)
            mask = cover >= 0.5 * area.full
            if not mask.any() or max(mask_box(mask)[2:]) <= max_size:
                break
            factor *= 1.0 - 0.25 / max_size
        thin = min(mask_box(mask)[2:]) if mask.any() else 0
        if thin < MIN_SIDE:
            raise InputError(
                f"--max-size {max_size} makes the object only {thin} pixels thin: use "
                f"{_size_needed(self.box)} or more, or 0"
            )
        clipped = mask & (area(self.clipped & self.mask) > 1e-6)
        return replace(
            self,
            image=resize_separately(self.image, self.mask, mask, area),
            mask=mask,
            clipped=clipped,
            scale=self.scale * factor,
            camera=None if self.camera is None else self.camera.scaled(factor),
            marks=self.marks.scaled(factor),
        )


def _size_needed(box: tuple[int, int, int, int]) -> int:
    return int(np.ceil((MIN_SIDE + 1) * max(box[2:]) / min(box[2:])))
