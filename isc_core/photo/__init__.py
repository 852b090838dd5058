"""Photos and masks: reading, linearising, resizing, and finding the object."""

from typing import TYPE_CHECKING

from ..lazy import exports
from .names import TRANSFERS, WholeFrame

if TYPE_CHECKING:
    from ..io.decoders import Raster, read_raster
    from .masks import check_mask, tidy_mask
    from .photo import Photo, PhotoSource
    from .reading import FLOAT_STEP, read_linear, read_photo
    from .transfer import encode_like
else:
    __getattr__ = exports(
        __name__,
        {
            "FLOAT_STEP": ".reading",
            "Photo": ".photo",
            "PhotoSource": ".photo",
            "Raster": "..io.decoders",
            "check_mask": ".masks",
            "encode_like": ".transfer",
            "read_linear": ".reading",
            "read_photo": ".reading",
            "read_raster": "..io.decoders",
            "tidy_mask": ".masks",
        },
    )

__all__ = [
    "FLOAT_STEP",
    "TRANSFERS",
    "Photo",
    "PhotoSource",
    "Raster",
    "WholeFrame",
    "check_mask",
    "encode_like",
    "read_linear",
    "read_photo",
    "read_raster",
    "tidy_mask",
]
