"""Damaging a file the way that finds faults in readers.

Problem: readers fail where a field says something else than what follows it. Random bytes are
refused at the first of them; a sound file with few changes goes far. Method: one to six of: flipped
bits, interesting values in place of 1, 2, 4 or 8 bytes in either order, parts removed, repeated,
exchanged, cut off, words of the format put in, numbers of a text replaced, and the rest of another
seed file behind this one's start. Everything hangs on the generator that is given, so that any
input can be made again from its number. Citation: B. P. Miller, L. Fredriksen, B. So (1990), "An
Empirical Study of the Reliability of UNIX Utilities", doi:10.1145/96267.96279; the mutations are
those that M. Zalewski's american fuzzy lop made usual (2013). Limits: no coverage guides it: what
is not near a seed file is not found.
"""

import random
import re
import struct
from collections.abc import Callable, Sequence

MOST_BYTES = 1 << 18
_EDGES = (
    0,
    1,
    2,
    3,
    7,
    8,
    9,
    16,
    127,
    128,
    255,
    256,
    4096,
    32767,
    32768,
    65535,
    65536,
    100_000,
    2**24,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**40,
    2**63 - 1,
    2**63,
    2**64 - 1,
)
_NUMBERS = (
    b"0",
    b"-1",
    b"1e999",
    b"-1e308",
    b"1e-320",
    b"NaN",
    b"-Infinity",
    b"2147483648",
    b"99999999999999999999",
    b"1" * 5000,
    b"true",
    b"null",
    b'""',
    b"[]",
    b"{}",
    b"0.1",
    b"-0",
    b'"\\ud800"',
    b"0x10",
)
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def mutated(
    rng: random.Random, data: bytes, others: Sequence[bytes], words: Sequence[bytes]
) -> bytes:
    """`data` with a few changes.

    `others`: further files of the format; `words`: what its fields hold. At most 256 KiB come out.
    """
    content = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 1, 1, 2, 2, 3, 6))):
        rng.choice(_CHANGES)(rng, content)
        if words and rng.random() < 0.15:
            _put_word(rng, content, rng.choice(words))
    if others and rng.random() < 0.05:
        content = _spliced(rng, content, rng.choice(others))
    return bytes(content[:MOST_BYTES])


def _place(rng: random.Random, content: bytearray) -> int:
    """Somewhere, more often near the start, where the headers are."""
    end = len(content)
    return rng.randrange(min(end, 256) if rng.random() < 0.5 else end) if end else 0


def _part(rng: random.Random, content: bytearray) -> slice:
    start = _place(rng, content)
    return slice(start, min(len(content), start + int(2 ** rng.uniform(0, 10))))


def _flip(rng: random.Random, content: bytearray) -> None:
    for _ in range(rng.choice((1, 1, 2, 8))):
        if content:
            content[_place(rng, content)] ^= 1 << rng.randrange(8)


def _set_number(rng: random.Random, content: bytearray) -> None:
    size, order = rng.choice((1, 2, 4, 4, 8)), rng.choice("<>")
    at = _place(rng, content)
    value = rng.choice(_EDGES) if rng.random() < 0.7 else rng.getrandbits(8 * size)
    code = {1: "B", 2: "H", 4: "I", 8: "Q"}[size]
    content[at : at + size] = struct.pack(order + code, value & (1 << 8 * size) - 1)


def _add_to_number(rng: random.Random, content: bytearray) -> None:
    size, order = rng.choice((1, 2, 4)), rng.choice(("little", "big"))
    at = _place(rng, content)
    if at + size <= len(content):
        value = int.from_bytes(content[at : at + size], order) + rng.randint(-16, 16)  # type: ignore[arg-type]
        content[at : at + size] = (value & (1 << 8 * size) - 1).to_bytes(size, order)  # type: ignore[arg-type]


def _remove(rng: random.Random, content: bytearray) -> None:
    del content[_part(rng, content)]


def _repeat(rng: random.Random, content: bytearray) -> None:
    part = _part(rng, content)
    content[part.start : part.start] = content[part] * rng.choice((1, 1, 1, 2, 16, 256))
    del content[MOST_BYTES:]


def _exchange(rng: random.Random, content: bytearray) -> None:
    one, other = _part(rng, content), _part(rng, content)
    content[one], content[other] = content[other], content[one]


def _cut(rng: random.Random, content: bytearray) -> None:
    if rng.random() < 0.3:
        del content[_place(rng, content) :]


def _noise(rng: random.Random, content: bytearray) -> None:
    part = _part(rng, content)
    content[part] = rng.randbytes(part.stop - part.start)


def _fill(rng: random.Random, content: bytearray) -> None:
    part = _part(rng, content)
    content[part] = bytes([rng.choice((0, 1, 127, 128, 255))]) * (part.stop - part.start)


def _replace_number(rng: random.Random, content: bytearray) -> None:
    """Of a text; in other files a run of digits is rare."""
    found = list(_NUMBER.finditer(bytes(content[: 1 << 14])))
    if found:
        start, end = rng.choice(found).span()
        content[start:end] = rng.choice(_NUMBERS)


def _nest(rng: random.Random, content: bytearray) -> None:
    if rng.random() < 0.05:
        at, deep = _place(rng, content), rng.choice((10, 2000, 100_000))
        content[at:at] = rng.choice((b"[", b'{"a":', b"(", b"(((((", b"\n", b"'", b"-")) * deep


def _put_word(rng: random.Random, content: bytearray, word: bytes) -> None:
    at = _place(rng, content)
    content[at : at + (len(word) if rng.random() < 0.7 else 0)] = word


def _spliced(rng: random.Random, content: bytearray, other: bytes) -> bytearray:
    return content[: _place(rng, content)] + bytearray(other[rng.randrange(len(other) + 1) :])


_CHANGES: tuple[Callable[[random.Random, bytearray], None], ...] = (
    _flip,
    _flip,
    _set_number,
    _set_number,
    _set_number,
    _add_to_number,
    _add_to_number,
    _remove,
    _repeat,
    _exchange,
    _cut,
    _noise,
    _fill,
    _replace_number,
    _replace_number,
    _nest,
)
