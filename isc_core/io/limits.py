"""Limits on the size of files, checked before any content is decompressed.

Problem: a file of a hundred bytes can claim a million pixels on each side, and a small archive can
unpack to more than the memory of a machine. The header of a file states the claimed size: width and
height, the shape and dtype of an array, the unpacked size of an archive's member. Readers first
check these against `Limits` and then decode.

Limits: only the unpacked size is bounded. The memory of a command is a multiple of it.
"""

from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError


@dataclass(frozen=True)
class Limits:
    """Limits of one file.

    The unpacked size is limited to the larger of `max_bytes` and `max_ratio` times the size of the
    file, so that large files are read but decompression bombs are not.

    Attributes
    ----------
    max_pixels : int
        Width times height of a picture.
    max_bytes : int
        Unpacked size of a file, in bytes.
    max_ratio : int
        Unpacked size over the size of the file.
    """

    max_pixels: int = 100_000_000
    max_bytes: int = 1 << 30
    max_ratio: int = 20

    def check_pixels(self, path: Path | str, width: int, height: int) -> None:
        """Raise `InputError` for an image with more than `max_pixels` pixels.

        Parameters
        ----------
        path : Path or str
            Prefix of the error message.
        width, height : int
            In pixels.

        Raises
        ------
        InputError
            If the image has more pixels.
        """
        if width * height > self.max_pixels:
            limit = f"{self.max_pixels / 1e6:g} megapixels"
            raise InputError(
                f"{path}: {width} x {height} pixels exceed the limit of {limit}: reduce the "
                "image, or raise --max-pixels"
            )

    def check_stored(self, path: Path | str, stored: int) -> None:
        """Raise `InputError` for a file larger than `max_bytes`, which is read into memory.

        Parameters
        ----------
        path : Path or str
            Prefix of the error message.
        stored : int
            Size of the file in bytes.

        Raises
        ------
        InputError
            If the file is larger.
        """
        if stored > self.max_bytes:
            raise InputError(
                f"{path} has {stored / 1e9:.1f} GB; the limit is {self.max_bytes / 1e9:.1f} GB: "
                "reduce it first"
            )

    def check_unpacked(self, path: Path | str, unpacked: int, stored: int) -> None:
        """Raise `InputError` for a file whose unpacked size exceeds the limit.

        Parameters
        ----------
        path : Path or str
            Prefix of the error message.
        unpacked, stored : int
            Bytes of its values, and of the file.
        """
        limit = max(self.max_bytes, self.max_ratio * stored)
        if unpacked > limit:
            raise InputError(
                f"{path}: unpacks to {unpacked / 1e9:.1f} GB; the limit is {limit / 1e9:.1f} GB: "
                "reduce its content"
            )


DEFAULT_LIMITS = Limits()
