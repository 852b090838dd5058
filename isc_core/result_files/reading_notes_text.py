"""Sentences for the notes on assumptions and omissions in reading a photo."""

from collections.abc import Iterable
from typing import Any

from ..io.reading_notes import ReadingNote, ReadingNoteKind

_TEXTS = {
    ReadingNoteKind.BROKEN_PROFILE: (
        "the photo's colour profile is damaged or does not fit its pixels: sRGB was assumed"
    ),
    ReadingNoteKind.TABLE_PROFILE: (
        "the photo's colour profile is a table of colours, which was applied with 8 bits: save the "
        "photo in sRGB or Adobe RGB to keep more"
    ),
    ReadingNoteKind.UNUSED_PROFILE: (
        "the photo's colour profile was replaced by --transfer: leave out --transfer to apply the "
        "profile"
    ),
    ReadingNoteKind.GAIN_MAP: "the photo's gain map (HDR) was ignored",
    ReadingNoteKind.UNKNOWN_CAMERA_COLOURS: (
        "the raw file does not describe the colours of its camera: hues may be wrong; export it as "
        "a 16-bit TIFF instead"
    ),
    ReadingNoteKind.OUT_OF_GAMUT: (
        "{value:.0%} of the object's pixels have colours outside Rec.709: they were clipped"
    ),
    ReadingNoteKind.ABOVE_WHITE: (
        "highlights over 64 times as bright as most of the object (HDR) were limited to that"
    ),
}


def reading_note_lines(notes: Iterable[ReadingNote]) -> list[str]:
    """Return the lines that a command prints about the reading of a photo.

    Parameters
    ----------
    notes : iterable of ReadingNote

    Returns
    -------
    list of str
        Each begins with "note: ".
    """
    return [f"note: {_TEXTS[one.kind].format(value=one.value or 0.0)}" for one in notes]


def stored_note_lines(stored: Any) -> list[str]:
    """Return these lines for the entry `input.reading_notes` of a decomposition.json.

    Parameters
    ----------
    stored : Any
        The entry; the file is not trusted, and invalid parts are ignored.

    Returns
    -------
    list of str
    """
    known = {kind.value: kind for kind in ReadingNoteKind}
    notes = [one for one in stored if isinstance(one, dict)] if isinstance(stored, list) else []
    return reading_note_lines(
        ReadingNote(known[str(one.get("kind"))], _share(one.get("value")))
        for one in notes
        if str(one.get("kind")) in known
    )


def _share(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and 0 <= value <= 1 else None
