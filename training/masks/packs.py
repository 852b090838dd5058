"""Ingredients of composites in files that are small enough to travel.

Equation: colours of bodies are JPEG files, at a quality at which they lose less than in the photos
that they become part of. Outside of a body they go on as the mean of the colours around, so that
its rim keeps its colour. Covers, and differences between neighbouring pixels of patterns and of
panoramas, which are half floats with 6 of their 10 binary digits, are compressed by LZMA.

Limits: colours are off by some hundredths, panoramas by up to 1 %.
"""

import io
import lzma
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from PIL import Image
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.io.atomic import new_file

SUFFIX = ".npz"
_FORMAT, _QUALITY = 1, 85
_AROUND = 15  # pixels: as wide as two of JPEG's blocks
_DROPPED = 4  # binary digits of half floats
_DAMAGES = (ValueError, KeyError, OSError, BadZipFile, EOFError, lzma.LZMAError)


@dataclass(frozen=True)
class Ingredients:
    """What to compose photos from.

    Attributes
    ----------
    bodies : (N, 4, SIDE, SIDE) uint8 ndarray
        sRGB and cover; the longer side of each body is `LENGTH` pixels.
    panoramas : (P, ROWS, 2 ROWS, 3) float16 ndarray
        Linear.
    patterns : (M, side, side) uint8 ndarray
        Of tables: shares of the second colour.
    """

    bodies: np.ndarray
    panoramas: np.ndarray
    patterns: np.ndarray

    def write(self, path: Path) -> int:
        """Write a file.

        Parameters
        ----------
        path : Path

        Returns
        -------
        int
            Its bytes.
        """
        files = [_jpeg(body) for body in self.bodies]
        digits = self.panoramas.view(np.uint16) >> _DROPPED
        steps = np.diff(digits, axis=2, prepend=np.uint16(0))
        arrays = {
            "format": np.array(_FORMAT),
            "colours": np.frombuffer(b"".join(files), np.uint8),
            "sizes": np.array([len(one) for one in files]),
            "covers": _stream(np.ascontiguousarray(self.bodies[:, 3])),
            # high bytes first: they hardly ever change
            "panoramas": _stream(np.stack([steps >> 8, steps & 255]).astype(np.uint8)),
            "rows": np.array(self.panoramas.shape[1]),
            "patterns": _stream(np.diff(self.patterns, prepend=np.uint8(0))),
            "side": np.array(self.patterns.shape[1]),
        }
        with new_file(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays)
        return path.stat().st_size

    @classmethod
    def read(cls, paths: Sequence[Path]) -> "Ingredients":
        """Read files.

        Parameters
        ----------
        paths : sequence of Path
            Bodies are those of all, panoramas and patterns those of the first.

        Returns
        -------
        Ingredients

        Raises
        ------
        InputError
            If one is no such file.
        """
        found = [_read(path) for path in paths]
        bodies = np.concatenate([one.bodies for one in found])
        return cls(bodies, found[0].panoramas, found[0].patterns)


def _read(path: Path) -> Ingredients:
    try:
        with np.load(path, allow_pickle=False) as data:
            if int(data["format"]) != _FORMAT:
                raise ValueError("it is of another version")
            return _unpacked({name: data[name] for name in data.files})
    except _DAMAGES as error:
        raise InputError(
            f"{path} holds no ingredients: {error}; make them with "
            "python -m training.masks.ingredients"
        ) from error


def _unpacked(data: dict[str, np.ndarray]) -> Ingredients:
    ends = np.cumsum(data["sizes"])
    parts = np.split(data["colours"], ends[:-1])
    colours = np.stack([np.asarray(Image.open(io.BytesIO(one.tobytes()))) for one in parts])
    covers = _bytes(data["covers"]).reshape(colours.shape[:3])[:, None]
    rows, side = int(data["rows"]), int(data["side"])
    high, low = _bytes(data["panoramas"]).reshape(2, -1, rows, 2 * rows, 3).astype(np.uint16)
    digits = np.cumsum((high << 8) | low, axis=2, dtype=np.uint16) << _DROPPED
    steps = _bytes(data["patterns"]).reshape(-1, side, side)
    return Ingredients(
        np.concatenate([colours.transpose(0, 3, 1, 2), covers], axis=1),
        digits.view(np.float16),
        np.cumsum(steps, axis=2, dtype=np.uint8),
    )


def _jpeg(body: np.ndarray) -> bytes:
    """The colours of a body (4, side, side), which go on outside of it."""
    weight = body[3:] / 255.0
    around = [
        ndimage.uniform_filter(one, (0, _AROUND, _AROUND)) for one in (body[:3] * weight, weight)
    ]
    mean = around[0] / np.maximum(around[1], 1e-6)
    colours = np.where(weight > 0, body[:3], mean).round().clip(0, 255).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(colours.transpose(1, 2, 0)).save(
        file, "JPEG", quality=_QUALITY, subsampling=0, optimize=True
    )
    return file.getvalue()


def _stream(values: np.ndarray) -> np.ndarray:
    return np.frombuffer(lzma.compress(values.tobytes(), preset=6), np.uint8)


def _bytes(stream: np.ndarray) -> np.ndarray:
    return np.frombuffer(lzma.decompress(stream.tobytes()), np.uint8)
