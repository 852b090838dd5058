"""Find the mask of the object in a photo, with or without hints."""

from typing import TYPE_CHECKING

from ..lazy import exports

if TYPE_CHECKING:
    from .finder import MaskSearch, read_each
    from .hints import Hints
    from .search import find_mask, find_masks, separate_parts
else:
    __getattr__ = exports(
        __name__,
        {
            "Hints": ".hints",
            "MaskSearch": ".finder",
            "find_mask": ".search",
            "find_masks": ".search",
            "read_each": ".finder",
            "separate_parts": ".search",
        },
    )

__all__ = [
    "Hints",
    "MaskSearch",
    "find_mask",
    "find_masks",
    "read_each",
    "separate_parts",
]
