"""What was assumed or left out when a file was read.

Values only: the sentences for people are made where they are shown
(`result_files.reading_notes_text`).
"""

from dataclasses import dataclass
from enum import StrEnum


class ReadingNoteKind(StrEnum):
    """What happened.

    Attributes
    ----------
    BROKEN_PROFILE
        The colour profile is damaged or does not fit the pixels: sRGB was assumed.
    TABLE_PROFILE
        The profile is a table of colours, which is applied with 8 bits.
    UNUSED_PROFILE
        The profile is a table of colours, and the user named another curve: it was not applied.
    GAIN_MAP
        The file has a gain map (HDR), which was ignored.
    UNKNOWN_CAMERA_COLOURS
        The colours of the camera are unknown: its raw colours were used.
    OUT_OF_GAMUT
        Colours of the object are outside of Rec.709; the value is their share of its pixels.
    """

    BROKEN_PROFILE = "broken profile"
    TABLE_PROFILE = "table profile"
    UNUSED_PROFILE = "unused profile"
    GAIN_MAP = "gain map"
    UNKNOWN_CAMERA_COLOURS = "unknown camera colours"
    OUT_OF_GAMUT = "out of gamut"


@dataclass(frozen=True)
class ReadingNote:
    """A note on how a file was read.

    Attributes
    ----------
    kind : ReadingNoteKind
        What happened.
    value : float or None
        See `ReadingNoteKind`, in [0, 1]; None where there is none.
    """

    kind: ReadingNoteKind
    value: float | None = None
