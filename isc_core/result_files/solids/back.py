"""Names of the kinds of back, for options too: nothing else is imported."""

from enum import StrEnum


class Back(StrEnum):
    """What a body has on the side that the photo does not show.

    Attributes
    ----------
    OPEN
        Nothing.
    FLAT
        A plane, and a wall along the outline.
    ROUNDED
        A surface as round as the outline.
    MIRRORED
        The front again.
    """

    OPEN = "open"
    FLAT = "flat"
    ROUNDED = "rounded"
    MIRRORED = "mirrored"
