"""Photos and masks: reading, linearising, resizing, and finding the object."""

from ..io.decoders import Raster, read_raster
from .masks import check_mask, tidy_mask
from .photo import Photo, PhotoSource
from .reading import FLOAT_STEP, read_linear, read_photo
from .transfer import TRANSFERS, encode_like

__all__ = [
    "FLOAT_STEP",
    "TRANSFERS",
    "Photo",
    "PhotoSource",
    "Raster",
    "check_mask",
    "encode_like",
    "read_linear",
    "read_photo",
    "read_raster",
    "tidy_mask",
]
