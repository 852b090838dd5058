"""File names in printable characters.

Problem: on Linux a file name may contain any bytes except `/` and zero. Python represents bytes
that are not UTF-8 by lone surrogates, which no text file, terminal or font accepts; and a name may
contain line breaks, or characters that move the cursor or change the writing direction.
"""

import unicodedata

_INVISIBLE = {"Cc", "Cs", "Zl", "Zp"}  # control, lone surrogate, line and paragraph separator
_BIDIRECTIONAL = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}


def readable(text: str) -> str:
    """Return `text` on one line, in printable characters that UTF-8 can encode.

    All others are escaped as in Python: `\\n`, `\\xe9`.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
    """
    return "".join(map(_readable, text))


def _readable(character: str) -> str:
    if 0xDC80 <= ord(character) <= 0xDCFF:  # a byte of a name that is not UTF-8
        return f"\\x{ord(character) - 0xDC00:02x}"
    if (
        unicodedata.category(character) in _INVISIBLE
        or unicodedata.bidirectional(character) in _BIDIRECTIONAL
    ):
        return character.encode("unicode_escape").decode("ascii")
    return character
