"""Detection of gain maps, with which some displays show an ordinary photo in HDR.

Phones store a second, small picture of the brightness relative to white (Ultra HDR and ISO 21496-1
in JPEG and HEIF, Apple's own in HEIC). The photo itself is complete without it.

Limits: the map is detected and ignored.
"""

from ..reading_notes import ReadingNote, ReadingNoteKind

_NAMES = (
    b"hdrgm:Version",
    b"urn:iso:std:iso:ts:21496:-1",
    b"urn:com:apple:photo:2020:aux:hdrgainmap",
)


def gain_map_notes(data: bytes) -> tuple[ReadingNote, ...]:
    """Return a note if a file has a gain map.

    Parameters
    ----------
    data : bytes
        The whole file.

    Returns
    -------
    tuple of ReadingNote
        Empty or one note.
    """
    found = any(name in data for name in _NAMES) or b"tmap" in data[8:64]  # a brand of HEIF
    return (ReadingNote(ReadingNoteKind.GAIN_MAP),) if found else ()
