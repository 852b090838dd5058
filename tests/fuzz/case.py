"""A sound file and its reader, and edits that damage the file.

Problem: readers fail where a field contradicts what follows it. Random bytes are refused at the
first of them; a sound file with a few edits gets far. Equation: one to six edits, each of which
overwrites, inserts, adds to, removes, copies, nests or cuts, with numbers at the edges of their
range and words of the format. Citation: B. P. Miller, L. Fredriksen, B. So (1990), "An Empirical
Study of the Reliability of UNIX Utilities", doi:10.1145/96267.96279; the edits are those that
M. Zalewski's american fuzzy lop made usual (2013). Limits: not guided by coverage; whatever is not
near a sound file is not reached.
"""

import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hypothesis import strategies as st

MOST_BYTES = 1 << 18
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
EDGES = (
    *(0, 1, 2, 3, 7, 8, 9, 16, 127, 128, 255, 256, 4096, 32767, 32768, 65535, 65536, 100_000),
    *(2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**63, 2**64 - 1),
)
TEXTS = (
    *b"0 -1 1e999 -1e308 1e-320 NaN -Infinity 2147483648 99999999999999999999 true null".split(),
    *b'"" [] {} 0.1 -0 "\\ud800" 0x10'.split(),
    b"1" * 5000,
)


def words(joined: bytes) -> tuple[bytes, ...]:
    """The words of a format, joined by `~`."""
    return tuple(joined.split(b"~"))


@dataclass(frozen=True)
class Case:
    """One sound file and its reader.

    Attributes
    ----------
    name : str
        Name of the file, as the reader wants it.
    data : bytes
        The part of the file that is damaged.
    read : callable
        The reader; takes the file's path.
    wrap : callable
        Makes the file from the damaged part: repairs checksums, compresses.
    beside : mapping of str to bytes
        Sound files in the same folder.
    """

    name: str
    data: bytes
    read: Callable[[Path], object]
    wrap: Callable[[bytes], bytes] = bytes
    beside: Mapping[str, bytes] = field(default_factory=dict)

    def put(self, folder: Path, data: bytes) -> Path:
        """Write the files of the case, with `data` in the damaged one; return its path."""
        for name, content in (*self.beside.items(), (self.name, self.wrap(data))):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
        return folder / self.name


@dataclass(frozen=True)
class Target:
    """A kind of file.

    Attributes
    ----------
    name : str
        Name of the kind.
    cases : callable
        Makes the cases.
    words : tuple of bytes
        Words that occur in such files.
    """

    name: str
    cases: Callable[[], tuple[Case, ...]]
    words: tuple[bytes, ...] = ()


@dataclass(frozen=True)
class Edit:
    """One edit, see `EDITS`; `at` and `size` in bytes, `at` modulo the length."""

    kind: str
    at: int
    size: int
    value: bytes

    def apply(self, content: bytearray) -> None:
        """Edit the content in place."""
        EDITS[self.kind](self, content, self.at % (len(content) + 1))
        del content[MOST_BYTES:]


def _overwrite(edit: Edit, content: bytearray, at: int) -> None:
    content[at : at + len(edit.value)] = edit.value


def _insert(edit: Edit, content: bytearray, at: int) -> None:
    content[at:at] = edit.value


def _remove(edit: Edit, content: bytearray, at: int) -> None:
    del content[at : at + edit.size]


def _copy(edit: Edit, content: bytearray, at: int) -> None:
    content[at:at] = content[edit.size : edit.size + at] * (1 + edit.size % 7)


def _fill(edit: Edit, content: bytearray, at: int) -> None:
    content[at : at + edit.size] = edit.value[:1] * edit.size


def _cut(edit: Edit, content: bytearray, at: int) -> None:
    del content[at:]


def _flip(edit: Edit, content: bytearray, at: int) -> None:
    content[at : at + 1] = bytes(byte ^ 1 << edit.size % 8 for byte in content[at : at + 1])


def _add(edit: Edit, content: bytearray, at: int) -> None:
    order = "<>"[edit.size % 2]
    if at + 4 <= len(content):
        (number,) = struct.unpack_from(f"{order}I", content, at)
        struct.pack_into(f"{order}I", content, at, (number + edit.size % 33 - 16) % 2**32)


def _replace_number(edit: Edit, content: bytearray, at: int) -> None:
    found = list(NUMBER.finditer(bytes(content[: 1 << 14])))
    if found:
        start, end = found[at % len(found)].span()
        content[start:end] = TEXTS[edit.size % len(TEXTS)]


def _nest(edit: Edit, content: bytearray, at: int) -> None:
    openings = (b"[", b'{"a":', b"(", b"(((((", b"\n", b"'", b"-")
    if edit.size > 900:  # seldom: such files are refused at once
        content[at:at] = openings[at % len(openings)] * (10, 2000, 100_000)[edit.size % 3]


EDITS: dict[str, Callable[[Edit, bytearray, int], None]] = {
    "overwrite": _overwrite,
    "insert": _insert,
    "remove": _remove,
    "copy": _copy,
    "fill": _fill,
    "cut": _cut,
    "flip": _flip,
    "add": _add,
    "replace number": _replace_number,
    "nest": _nest,
}
KINDS = (*EDITS, "overwrite", "overwrite", "flip", "add", "replace number")
CODES = ("B", "<H", ">H", "<I", ">I", "<Q", ">Q")


def _edit(drawn: bytes, known: tuple[bytes, ...]) -> Edit:
    """The edit that 16 bytes stand for; drawing its fields one by one takes ten times as long."""
    kind, far, source, code = drawn[0], drawn[1] % 2, drawn[2] % 3, CODES[drawn[3] % len(CODES)]
    at, size = int.from_bytes(drawn[4:7], "little"), int.from_bytes(drawn[7:9], "little") % 1024
    if source == 0:
        number = EDGES[drawn[9] % len(EDGES)]
        value = struct.pack(code, number % 256 ** struct.calcsize(code))
    elif source == 1 and known:
        value = known[drawn[9] % len(known)]
    else:
        value = drawn[9 : 10 + size % 7]
    return Edit(KINDS[kind % len(KINDS)], at % (MOST_BYTES if far else 256), size, value)


def edits(known: tuple[bytes, ...]) -> st.SearchStrategy[list[Edit]]:
    """One to six edits that use the words of a format; half of them near the start."""
    drawn = st.lists(st.binary(min_size=16, max_size=16), min_size=1, max_size=6)
    return drawn.map(lambda rows: [_edit(row, known) for row in rows])


def damaged(case: Case, changes: list[Edit]) -> bytes:
    """The case's data after some edits."""
    content = bytearray(case.data)
    for change in changes:
        change.apply(content)
    return bytes(content)
