"""Finding the mask of the thing that a photo shows: from the photo alone, or from hints."""

from typing import TYPE_CHECKING

from ..lazy import exports

if TYPE_CHECKING:
    from .hints import Hints
    from .search import FoundMask, find_mask, find_masks
else:
    __getattr__ = exports(
        __name__,
        {
            "FoundMask": ".search",
            "Hints": ".hints",
            "find_mask": ".search",
            "find_masks": ".search",
        },
    )

