"""Checksums by which the add-on knows data of its own again."""

import zlib


def crc32_of(*parts: bytes | memoryview) -> str:
    """Return the CRC-32 of data.

    Parameters
    ----------
    *parts : bytes or memoryview
        One after the other.

    Returns
    -------
    str
        Eight hexadecimal digits: Blender's integer properties have a sign.
    """
    number = 0
    for part in parts:
        number = zlib.crc32(part, number)
    return f"{number:08x}"
