"""ICC profiles: the colour space of an image file, as curves and colorants.

Problem: LittleCMS in Pillow converts with 8 bits per channel. A photo of 16 bits keeps its
precision if its profile consists of three colorants and curves, as those of cameras, displays and
editors do: the tags `rXYZ`, `gXYZ`, `bXYZ` and `rTRC`, `gTRC`, `bTRC`, or `kTRC` for grey. `photo`
converts such colours in floating point. A profile with only a table of colours is applied by
LittleCMS, see `table_profile`.

Citation: International Color Consortium, Specification ICC.1:2022 (profile version 4.4), and
ICC.1:2001-04 (version 2.4).

Limits: if a profile has both, curves and colorants are used, not the table. A profile of another
colour model than that of the pixels is treated as broken.
"""

import struct

import numpy as np

from ...printable_names import readable
from ...reading_notes import ReadingNote, ReadingNoteKind
from .space import ColourSpace, PowerCurve, SampledCurve, ToneCurve

MOST_BYTES = 1 << 24
_MOST_TAGS, _MOST_SAMPLES, _LONGEST_NAME = 100, 65536, 60
_NUMBERS = {0: "g", 1: "gab", 2: "gabe", 3: "gabcd", 4: "gabcdef"}
_GRID = np.linspace(0.0, 1.0, 1025)
_BROKEN = (ReadingNote(ReadingNoteKind.BROKEN_PROFILE),)


def space_of_profile(
    profile: bytes | None, channels: int
) -> tuple[ColourSpace | None, tuple[ReadingNote, ...]]:
    """Return the colour space that an embedded profile describes.

    Parameters
    ----------
    profile : bytes or None
        The embedded profile; None where parts of it are missing.
    channels : int
        Of the pixels without alpha, 1 or 3.

    Returns
    -------
    space : ColourSpace or None
        None for a broken profile.
    notes : tuple of ReadingNote
    """
    try:
        space = read_profile(profile or b"", channels)
    except ValueError:
        return None, _BROKEN
    table = (ReadingNote(ReadingNoteKind.TABLE_PROFILE),) if space.is_table else ()
    return space, table


def read_profile(profile: bytes, channels: int) -> ColourSpace:
    """Read a profile.

    Parameters
    ----------
    profile : bytes
    channels : int
        Of the pixels without alpha, 1 or 3.

    Returns
    -------
    ColourSpace

    Raises
    ------
    ValueError
        If the profile is damaged, or not for grey or RGB pixels.
    """
    try:
        tags, model = _tags(profile), profile[16:20]
        name = _name(tags.get(b"desc", b""))
        if model == b"GRAY":
            return ColourSpace(name, (_curve(tags[b"kTRC"]),), profile=profile)
        if model != b"RGB ":
            raise ValueError("a profile of another colour model")
        if not {b"rXYZ", b"gXYZ", b"bXYZ", b"rTRC", b"gTRC", b"bTRC"} <= tags.keys():
            if channels != 3:
                raise ValueError("a table of colours for grey pixels")
            from .table_profile import check_table  # few profiles are tables: LittleCMS

            check_table(profile)
            return ColourSpace(name, profile=profile, is_table=True)
        curves = tuple(_curve(tags[b"%cTRC" % letter]) for letter in b"rgb")
        colorants = np.stack([_xyz(tags[b"%cXYZ" % letter]) for letter in b"rgb"], axis=1)
    except (struct.error, KeyError) as error:
        raise ValueError("a damaged profile") from error
    if np.linalg.det(colorants) < 1e-4 or not (colorants.sum(axis=1) > 0.1).all():
        raise ValueError("colorants that span no colours")
    return ColourSpace(name, curves if channels == 3 else curves[1:2], colorants, profile)


def _tags(profile: bytes) -> dict[bytes, bytes]:
    """The content of each tag by its signature."""
    if profile[36:40] != b"acsp" or (profile[20:24] != b"XYZ " and profile[20:24] != b"Lab "):
        raise ValueError("not a profile")
    (count,) = struct.unpack_from(">I", profile, 128)
    if count > _MOST_TAGS or len(profile) > MOST_BYTES:
        raise ValueError("too large a profile")
    entries = (struct.unpack_from(">4sII", profile, 132 + 12 * k) for k in range(count))
    return {name: profile[start : start + size] for name, start, size in entries}


def _curve(content: bytes) -> ToneCurve:
    """A tag of type `curv` or `para`; raises ValueError for a decreasing or constant curve."""
    kind, curve = content[:4], None
    if kind == b"curv":
        curve = _sampled(content)
    elif kind == b"para":
        (form,) = struct.unpack_from(">H", content, 8)
        letters = _NUMBERS.get(form, "")
        numbers = [n / 65536 for n in struct.unpack_from(f">{len(letters)}i", content, 12)]
        curve = _power(form, dict(zip(letters, numbers, strict=True)))
    if curve is None:
        raise ValueError("an unknown kind of curve")
    values = curve(_GRID)
    if not np.isfinite(values).all() or (np.diff(values) < -1e-3).any() or np.ptp(values) < 0.1:
        raise ValueError("not a tone curve")
    return curve


def _sampled(content: bytes) -> ToneCurve:
    (count,) = struct.unpack_from(">I", content, 8)
    if count > _MOST_SAMPLES:
        raise ValueError("too long a curve")
    if count == 0:
        return PowerCurve(1.0)
    samples = np.array(struct.unpack_from(f">{count}H", content, 12), float)
    if count == 1:
        return PowerCurve(samples[0] / 256)
    return SampledCurve(np.maximum.accumulate(samples) / 65535)


def _power(form: int, given: dict[str, float]) -> PowerCurve | None:
    """The parametric curve of a form 0 to 4, in the terms of `PowerCurve`."""
    if not given or not 0.1 <= given["g"] <= 10 or (form in (1, 2) and given["a"] <= 0):
        return None
    offset = given.pop("e", 0.0)
    if form in (1, 2):  # constant below the zero of the power's base
        return PowerCurve(**given, d=-given["b"] / given["a"], e=offset, f=offset)
    return PowerCurve(**given, e=offset)


def _xyz(content: bytes) -> np.ndarray:
    if content[:4] != b"XYZ ":
        raise ValueError("not a colour")
    return np.array(struct.unpack_from(">3i", content, 8)) / 65536


def _name(content: bytes) -> str:
    """The description of a profile, "unnamed" without a readable one."""
    text = ""
    if content[:4] == b"desc":
        (length,) = struct.unpack_from(">I", content, 8)
        text = content[12 : 12 + min(length, 1000)].decode("latin-1")
    elif content[:4] == b"mluc":
        size, start = struct.unpack_from(">II", content, 20)
        text = content[start : start + min(size, 1000)].decode("utf-16-be", "ignore")
    return readable(text.strip("\0 \n"))[:_LONGEST_NAME] or "unnamed"
