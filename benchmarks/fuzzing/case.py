"""What is damaged, and which reader gets it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path


def unchanged(data: bytes) -> bytes:
    """The bytes as they are: nothing has to be mended."""
    return data


@dataclass(frozen=True)
class Case:
    """One sound file and its reader.

    `name`: of the file, as the reader wants it. `data`: what is damaged. `read`: the reader, given
    the file's path. `wrap`: makes the file of the damaged data (mends checksums, packs), so that
    damage gets behind them. `beside`: sound files in the same folder.
    """

    name: str
    data: bytes
    read: Callable[[Path], object]
    wrap: Callable[[bytes], bytes] = unchanged
    beside: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Target:
    """A kind of file.

    `cases`: makes them, when they are wanted. `words`: what stands in such files.
    """

    name: str
    cases: Callable[[], tuple[Case, ...]]
    words: tuple[bytes, ...] = ()
