"""The kinds of back, without other imports, for options."""

from enum import StrEnum


class Back(StrEnum):
    """The unobserved side of a solid.

    Attributes
    ----------
    OPEN
        No back.
    FLAT
        A plane, and a wall along the outline.
    ROUNDED
        A surface as round as the outline.
    MIRRORED
        The mirrored front.
    """

    OPEN = "open"
    FLAT = "flat"
    ROUNDED = "rounded"
    MIRRORED = "mirrored"
