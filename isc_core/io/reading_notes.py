"""Notes on assumptions and omissions in reading a file.

Only values; the sentences for users are in `result_files.reading_notes_text`.
"""

from dataclasses import dataclass
from enum import StrEnum


class ReadingNoteKind(StrEnum):
    """The kind of a note.

    Attributes
    ----------
    BROKEN_PROFILE
        The colour profile is damaged or does not fit the pixels: sRGB was assumed.
    TABLE_PROFILE
        The profile is a table of colours, which was applied with 8 bits.
    UNUSED_PROFILE
        The profile is a table of colours, and the user chose another curve: it was not applied.
    GAIN_MAP
        The file has a gain map (HDR), which was ignored.
    UNKNOWN_CAMERA_COLOURS
        The colours of the camera are unknown: its raw colours were used.
    OUT_OF_GAMUT
        Colours of the object are outside Rec.709; the value is their share of its pixels.
    ABOVE_WHITE
        A float file has highlights above the object's white: they were limited to it.
    """

    BROKEN_PROFILE = "broken profile"
    TABLE_PROFILE = "table profile"
    UNUSED_PROFILE = "unused profile"
    GAIN_MAP = "gain map"
    UNKNOWN_CAMERA_COLOURS = "unknown camera colours"
    OUT_OF_GAMUT = "out of gamut"
    ABOVE_WHITE = "above white"


@dataclass(frozen=True)
class ReadingNote:
    """A note on how a file was read.

    Attributes
    ----------
    kind : ReadingNoteKind
        The kind of the note.
    value : float or None
        See `ReadingNoteKind`, in [0, 1]; None for kinds without a value.
    """

    kind: ReadingNoteKind
    value: float | None = None
