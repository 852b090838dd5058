"""Gain maps: what turns an ordinary photo into an HDR one on some screens.

Phones store a second, small picture of how much brighter than white each place is (Ultra HDR and
ISO 21496-1 in JPEG and HEIF, Apple's own in HEIC). The photo itself is complete without it.

Limits: the map is recognised and left out.
"""

from ..reading_notes import ReadingNote, ReadingNoteKind

_NAMES = (
    b"hdrgm:Version",
    b"urn:iso:std:iso:ts:21496:-1",
    b"urn:com:apple:photo:2020:aux:hdrgainmap",
)


def gain_map_notes(data: bytes) -> tuple[ReadingNote, ...]:
    """Return the note on a gain map, where a file has one.

    Parameters
    ----------
    data : bytes
        The whole file.

    Returns
    -------
    tuple of ReadingNote
        None or one.
    """
    found = any(name in data for name in _NAMES) or b"tmap" in data[8:64]  # a brand of HEIF
    return (ReadingNote(ReadingNoteKind.GAIN_MAP),) if found else ()
