"""The colour space of a PNG, from its chunks in order of precedence.

    cICP   code points, see `cicp`
    iCCP   an ICC profile, see `icc`
    sRGB   sRGB
    gAMA   a power law; cHRM: the primaries and white

Citation: W3C, "Portable Network Graphics (PNG) Specification", third edition (2025), section 4.3.

Limits: a gAMA within 1 % of 1 / 2.2 is treated as the curve of sRGB, for which writers store it.
"""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...reading_notes import ReadingNote
from .cicp import space_of_code_points
from .icc import MOST_BYTES, space_of_profile
from .space import LINEAR, ColourSpace, PowerCurve, ToneCurve, colorants_of

COLOUR_CHUNKS = (b"cICP", b"iCCP", b"sRGB", b"gAMA", b"cHRM")


def space_of_chunks(
    chunks: Mapping[bytes, bytes], channels: int, path: Path
) -> tuple[ColourSpace | None, tuple[ReadingNote, ...]]:
    """Return the colour space that the chunks of a PNG describe.

    Parameters
    ----------
    chunks : mapping of bytes to bytes
        The content of each of `COLOUR_CHUNKS` that the file has.
    channels : int
        Of the pixels without alpha, 1 or 3.
    path : Path
        Prefix of the error message.

    Returns
    -------
    space : ColourSpace or None
        None for sRGB and without colour chunks.
    notes : tuple of ReadingNote

    Raises
    ------
    InputError
        For an HDR curve.
    """
    if len(chunks.get(b"cICP", b"")) == 4:
        return space_of_code_points(chunks[b"cICP"][0], chunks[b"cICP"][1], path), ()
    if b"iCCP" in chunks:
        return space_of_profile(_profile(chunks[b"iCCP"]), channels)
    if b"sRGB" in chunks:
        return None, ()
    curves, colorants = _curve(chunks.get(b"gAMA", b"")), _colorants(chunks.get(b"cHRM", b""))
    if not curves and colorants is None:
        return None, ()
    return ColourSpace("gAMA and cHRM of the PNG", curves, colorants), ()


def profile_chunk(profile: bytes) -> bytes:
    """Return the content of the chunk iCCP for a profile.

    Parameters
    ----------
    profile : bytes

    Returns
    -------
    bytes
    """
    return b"profile\0\0" + zlib.compress(profile)


def _profile(chunk: bytes) -> bytes | None:
    """The unpacked profile; None for a damaged one, or one of more than `MOST_BYTES`."""
    unpack = zlib.decompressobj()
    try:
        profile = unpack.decompress(chunk[chunk.index(b"\0") + 2 :], MOST_BYTES)
    except (zlib.error, ValueError):
        return None
    return profile if unpack.eof else None


def _curve(chunk: bytes) -> tuple[ToneCurve, ...]:
    stored = int.from_bytes(chunk, "big") / 100_000 if len(chunk) == 4 else 0.0
    if not 0.1 <= stored <= 10 or abs(2.2 * stored - 1) < 0.01:
        return ()
    return (LINEAR if stored == 1 else PowerCurve(1 / stored),)


def _colorants(chunk: bytes) -> np.ndarray | None:
    if len(chunk) != 32:
        return None
    white, *primaries = np.array(struct.unpack(">8I", chunk)).reshape(4, 2) / 100_000
    try:
        return colorants_of(np.array([*primaries, white]))
    except ValueError:
        return None
