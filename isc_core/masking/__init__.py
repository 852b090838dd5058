"""Find the mask of the object in a photo, with or without hints of the user."""

from typing import TYPE_CHECKING

from ..lazy import exports

if TYPE_CHECKING:
    from .components import connected_components
    from .finder import MaskSearch, read_each_object
    from .hints import Hints
    from .search import find_mask, find_masks
else:
    __getattr__ = exports(
        __name__,
        {
            "Hints": ".hints",
            "MaskSearch": ".finder",
            "connected_components": ".components",
            "find_mask": ".search",
            "find_masks": ".search",
            "read_each_object": ".finder",
        },
    )

__all__ = [
    "Hints",
    "MaskSearch",
    "connected_components",
    "find_mask",
    "find_masks",
    "read_each_object",
]
