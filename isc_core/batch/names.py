"""Names of results, from arbitrary file names.

Problem: a result is a folder in the output, named after its image. Images of different folders may
have the same name, and a name in a manifest may contain "..", separators, control characters or a
device's name. Names must be safe on every file system, unique ignoring case, and independent of the
order of the inputs, so that a resumed run finds the results of the previous one.

Method: if several images have the same name, a hash of image, mask and options is appended to each.
This takes two passes over the inputs: the first keeps 16 bytes per image, hashes of names and of
images, sorts them with NumPy and finds duplicates.

Limits: hashes have 64 bits; among a million images two different ones collide with a probability of
3e-8, and the later one is skipped.
"""

import hashlib
import re
import unicodedata
from array import array
from collections.abc import Iterable

import numpy as np

from ..errors import InputError
from .item import BatchItem

_MAX_BYTES = 120  # temporary siblings are longer, and file systems allow 255
_SAFE = re.compile(r"[0-9A-Za-z_][0-9A-Za-z_.-]{0,99}(?<!\.)")
_UNSAFE_RUN = re.compile(r"[^\w.-]+")
_HASHED = re.compile(r"-[0-9a-f]{12}")
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
# Files that the run writes into the output folder.
OWN_FILES = (
    "failures.jsonl",
    "summary.html",
    "summary.csv",
    "summary.jsonl",
    "summary-pages",
    "thumbnails",
)


def safe_name(text: str) -> str:
    """Return `text` as the name of a folder.

    Letters, digits, ".", "-" and "_" are kept, runs of other characters become "_".

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        Never empty, hidden or reserved.
    """
    name = text
    if not _SAFE.fullmatch(name):
        name = _UNSAFE_RUN.sub("_", unicodedata.normalize("NFC", text)).strip(".-") or "image"
        while len(name.encode("utf-8")) > _MAX_BYTES:
            name = name[:-1]
        name = name.rstrip(".-") or "image"
    if name.casefold() in OWN_FILES or _DEVICES.fullmatch(name):
        name = f"_{name}"
    return name


def check_given(name: str, where: str) -> str:
    """Return a name from a manifest if it is valid.

    Parameters
    ----------
    name : str
    where : str
        Prefix of the error message.

    Returns
    -------
    str

    Raises
    ------
    InputError
        If the name is a path or reserved.
    """
    if (
        "/" in name
        or "\\" in name
        or any(ord(letter) < 32 for letter in name)
        or name.strip(". ") == ""
    ):
        raise InputError(
            f"{where}: {name!r} is not a valid result name: use a name without /, \\ and control "
            "characters"
        )
    if name.casefold() in OWN_FILES or _DEVICES.fullmatch(name):
        raise InputError(f"{where}: the name {name!r} is reserved: choose another")
    return name


def wanted_name(item: BatchItem) -> str:
    """Return the name of an item's result if no other item has the same name.

    Parameters
    ----------
    item : BatchItem

    Returns
    -------
    str
        A safe file name.
    """
    if item.name:
        return safe_name(item.name)
    file = item.image.rstrip("/").rpartition("/")[2]
    return safe_name(file.rpartition(".")[0] or file)


class Names:
    """Assigns a name to every item of a stream; the constructor reads it once."""

    def __init__(self, items: Iterable[BatchItem]) -> None:
        names, identities = array("Q"), array("Q")
        for item in items:
            names.append(_hash(wanted_name(item).casefold()))
            identities.append(_hash(_identity(item)))
        self.count = len(names)
        name, identity = (
            np.frombuffer(hashes, np.uint64) if self.count else np.zeros(0, np.uint64)
            for hashes in (names, identities)
        )
        self._repeated = _repeated(np.sort(identity))
        order = np.lexsort((identity, name))
        name, identity = name[order], identity[order]
        new = np.append(True, (name[1:] != name[:-1]) | (identity[1:] != identity[:-1]))[
            : self.count
        ]
        self._shared = _repeated(name[new])
        self._used: set[int] = set()

    def name(self, item: BatchItem) -> str | None:
        """Return an item's name.

        Parameters
        ----------
        item : BatchItem
            One of the stream that the constructor read.

        Returns
        -------
        str or None
            None for a duplicate item in this pass.
        """
        identity = _identity(item)
        if (number := _hash(identity)) in self._repeated:
            if number in self._used:
                return None
            self._used.add(number)
        name = wanted_name(item)
        if _hash(name.casefold()) in self._shared or _HASHED.fullmatch(name[-13:]):
            return f"{name}-{_digest(identity).hex()[:12]}"
        return name


def _identity(item: BatchItem) -> str:
    return "\0".join((item.label or item.image, item.mask, item.name, repr(item.options)))


def _digest(text: str) -> bytes:
    return hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=8).digest()


def _hash(text: str) -> int:
    return int.from_bytes(_digest(text), "little")


def _repeated(values: np.ndarray) -> frozenset[int]:
    """The values that occur more than once in a sorted array."""
    return frozenset(np.unique(values[1:][values[1:] == values[:-1]]).tolist())
