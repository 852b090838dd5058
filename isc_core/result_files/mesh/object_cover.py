"""Fractional coverage of the maps' pixels by the object.

Problem: the maps of a result end at pixels that the object covers by half. The edge of a mask that
was found in the photo, of a soft mask and of an alpha channel is known with subpixel accuracy:
`mask.png` has the coverage of each of the photo's pixels.

Equation: the coverage of a pixel of the maps is the mean over its area. Beyond two pixels from the
object it is 0, because the photo may show other objects, unless the rim is soft (`photo.soft_rim`)
and the pixel is connected to the object by partly covered pixels. There the coverage is the opacity
of the surface. `ObjectCover.alpha` is the opacity of all textures: in a part of the frame, it is
that of the frame.

Citation: coverage as opacity: T. Porter and T. Duff, "Compositing digital images", SIGGRAPH 1984,
doi:10.1145/800031.808606.

Limits: without that file the edge is that of the maps' binary mask.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...filters.components import labelled
from ...filters.morphology import dilated
from ...imaging.area_resize import AreaFilter, reduced_count
from ...imaging.bounding_box import FramePart, mask_slices
from ...imaging.srgb import share_codes
from ...imaging.upsampling import enlarged
from ...io.decoders import read_raster
from ...io.limits import DEFAULT_LIMITS
from ...photo.soft_rim import rim_reach, soft_rim
from ...scene.part_of_result import ResultPart
from ..solids.rim import Rim

_NEAR = 2  # pixels
_SOME = 0.02  # of a pixel: less is ignored


@dataclass(frozen=True, eq=False)
class ObjectCover:
    """The object's coverage of the maps' pixels.

    Attributes
    ----------
    share : (H, W) float32 ndarray
        In [0, 1].
    soft : (H, W) bool ndarray or None
        Where the rim is soft, and some pixels around; None without a soft rim.
    fine : (h, w) uint8 ndarray or None
        The coverage of the photo's pixels, in codes.
    scale : float
        Map pixels per pixel of `fine`.
    """

    share: np.ndarray
    soft: np.ndarray | None = None
    fine: np.ndarray | None = None
    scale: float = 1.0

    def rim(self, part: FramePart) -> Rim:
        """Return the rim of the object.

        Parameters
        ----------
        part : FramePart
            Of the maps.

        Returns
        -------
        Rim
        """
        return Rim(part.cut(self.share), None if self.soft is None else part.cut(self.soft))

    def alpha(self, part: FramePart) -> np.ndarray | None:
        """Return the opacity of the surface, which is 1 except at soft rims.

        Parameters
        ----------
        part : FramePart
            Of the maps, or of a texture over their frame.

        Returns
        -------
        (h, w) uint8 ndarray or None
            Codes; None without a soft rim.
        """
        if self.soft is None or self.fine is None:
            return None
        factor = max(1.0, part.shape[1] / self.share.shape[1])
        cover = _resized(self.fine, self.scale * factor, part)
        start = (part.rows.start, part.columns.start)
        weight = enlarged(self.soft.astype(np.float32), part.size, factor, start)
        return np.rint(255 * (1 - weight * (1 - cover))).astype(np.uint8)


def read_cover(mask_file: Path, source: Mapping[str, Any]) -> np.ndarray | None:
    """Read the coverage in a result's `mask.png`.

    Parameters
    ----------
    mask_file : Path
        May be absent.
    source : mapping
        `Provenance.input` of the result. The file may have as many pixels as its photo, however
        many these are.

    Returns
    -------
    (h, w) ndarray or None
        0 to 1, of the photo's pixels; None without the file.

    Raises
    ------
    InputError
        If the file is not an image, or has more pixels than the photo and the usual limit.
    """
    if not mask_file.is_file():
        return None
    pixels = math.prod(source.get("size", ()))
    limits = replace(DEFAULT_LIMITS, max_pixels=max(DEFAULT_LIMITS.max_pixels, pixels))
    raster = read_raster(mask_file, limits)
    values = raster.values.reshape(*raster.values.shape[:2], -1)[..., 0]
    return values.astype(np.float32) / np.iinfo(raster.values.dtype).max


def object_cover(stored: ResultPart, given: np.ndarray | None) -> ObjectCover | None:
    """Return the object's coverage of the maps' pixels.

    Parameters
    ----------
    stored : ResultPart
    given : (h, w) ndarray or None
        Coverage of the photo's pixels, 0 to 1.

    Returns
    -------
    ObjectCover or None
        Of the frame; None if only the mask is known.
    """
    if given is None:
        return None
    codes = share_codes(given)
    if not ((codes > 0) & (codes < 255)).any():
        return None
    source, mask = stored.result.provenance.input, stored.mask
    scale = min(1.0, float(source.get("scale", 1.0)))
    if mask.shape != tuple(reduced_count(count, scale) for count in codes.shape):
        return None  # it is of another photo
    own = source.get("mask_from") == "alpha"
    if scale < 1:
        seen = _reduced_part(codes, scale, stored.part.shape)
        share = seen.placed(_resized(codes, scale, seen))
        place = FramePart.around(mask | (share > 0), rim_reach(mask, own))
        share = place.cut(share)
    else:
        place = FramePart.around(mask | (codes > 0), rim_reach(mask, own))
        share = _resized(codes, 1.0, place)
    share, soft = _near(share, place.cut(mask), own)
    whole = None if soft is None else place.placed(soft)
    return ObjectCover(place.placed(share), whole, codes, scale)


def _reduced_part(codes: np.ndarray, scale: float, shape: tuple[int, int]) -> FramePart:
    """The part of the reduced frame that the covered pixels, of which there are some, touch."""
    rows, columns = (
        slice(int(seen.start * scale), min(int(np.ceil(seen.stop * scale)), size))
        for seen, size in zip(mask_slices(codes), shape, strict=True)
    )
    return FramePart(rows, columns, shape)


def _near(share: np.ndarray, mask: np.ndarray, own: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """The coverage of the object alone, and where its rim is soft."""
    near = dilated(mask, _NEAR)
    way = near | ((share > _SOME) & (share < 0.5))
    parts, count = labelled(way)
    reached = np.zeros(count + 1, bool)
    reached[parts[mask]] = True
    share[~reached[parts]] = 0
    soft = soft_rim(share, mask, own)
    share[~near if soft is None else ~(near | soft)] = 0
    return share, soft


def _resized(codes: np.ndarray, scale: float, part: FramePart) -> np.ndarray:
    """The coverage (h, w) float32 of a part at a scale, unchanged from 1; 0 beyond the photo."""
    if scale < 1:
        cover = np.clip(AreaFilter.of(codes.shape, scale).means(codes, part) / 255, 0, 1)
    else:
        cover = part.cut(codes).astype(np.float32) / 255
    found = np.zeros(part.size, np.float32)
    rows, columns = cover.shape
    found[:rows, :columns] = cover
    return found
