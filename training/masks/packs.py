"""Compressed files of the ingredients of composites.

Problem: thousands of cut-outs and panoramas must be small enough to be copied to another machine.

Equation: colours of cut-outs are JPEG files, whose loss is smaller than that of the JPEG files of
the composites. Outside the object, they continue with the mean of the nearby colours, so that the
rim keeps its colour. LZMA compresses coverage and, as differences between neighbouring pixels,
patterns and panoramas; of panoramas, in half floats, 6 of the 10 bits of the mantissa are kept.

Limits: colours have errors of a few hundredths, panoramas of up to 1 %.
"""

import io
import lzma
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.io.atomic import new_file

from ..archives import open_archive

SUFFIX = ".npz"
_FORMAT, _QUALITY = 1, 85
_BORDER = 15  # pixels: about two blocks of JPEG
_DROPPED = 4  # bits of the mantissa


@dataclass(frozen=True, eq=False)
class Ingredients:
    """Ingredients of composites.

    Attributes
    ----------
    cutouts : (N, 4, SIDE, SIDE) uint8 ndarray
        sRGB and coverage; the longer side of each object is `LENGTH` pixels.
    panoramas : (P, ROWS, 2 ROWS, 3) float16 ndarray
        Linear.
    patterns : (M, side, side) uint8 ndarray
        Of tables: fraction of the second colour.
    """

    cutouts: np.ndarray
    panoramas: np.ndarray
    patterns: np.ndarray

    @classmethod
    def of_cutouts(cls, cutouts: np.ndarray) -> "Ingredients":
        """Make ingredients without backgrounds, to be read after others.

        Parameters
        ----------
        cutouts : (N, 4, SIDE, SIDE) uint8 ndarray

        Returns
        -------
        Ingredients
        """
        return cls(cutouts, np.zeros((0, 1, 2, 3), np.float16), np.zeros((0, 1, 1), np.uint8))

    def write(self, path: Path) -> int:
        """Write a file.

        Parameters
        ----------
        path : Path

        Returns
        -------
        int
            Its size, bytes.
        """
        files = [_jpeg(one) for one in self.cutouts]
        digits = self.panoramas.view(np.uint16) >> _DROPPED
        steps = np.diff(digits, axis=2, prepend=np.uint16(0))
        arrays = {
            "format": np.array(_FORMAT),
            "colours": np.frombuffer(b"".join(files), np.uint8),
            "sizes": np.array([len(one) for one in files]),
            "covers": _compressed(np.ascontiguousarray(self.cutouts[:, 3])),
            # high bytes first: they hardly ever change
            "panoramas": _compressed(np.stack([steps >> 8, steps & 255]).astype(np.uint8)),
            "rows": np.array(self.panoramas.shape[1]),
            "patterns": _compressed(np.diff(self.patterns, prepend=np.uint8(0))),
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
            Cut-outs are those of all files, panoramas and patterns those of the first.

        Returns
        -------
        Ingredients

        Raises
        ------
        InputError
            If a file does not contain ingredients.
        """
        found = [_read(path) for path in paths]
        cutouts = np.concatenate([one.cutouts for one in found])
        return cls(cutouts, found[0].panoramas, found[0].patterns)


def _read(path: Path) -> Ingredients:
    remedy = "make it again with python -m training.masks.ingredients"
    with open_archive(path, "a file of ingredients", remedy) as data:
        if int(data["format"]) != _FORMAT:
            raise InputError(f"{path} is a file of ingredients of another version: {remedy}")
        return _unpacked({name: data[name] for name in data.files})


def _unpacked(data: dict[str, np.ndarray]) -> Ingredients:
    ends = np.cumsum(data["sizes"])
    parts = np.split(data["colours"], ends[:-1])
    colours = np.stack([np.asarray(Image.open(io.BytesIO(one.tobytes()))) for one in parts])
    covers = _decompressed(data["covers"]).reshape(colours.shape[:3])[:, None]
    rows, side = int(data["rows"]), int(data["side"])
    high, low = _decompressed(data["panoramas"]).reshape(2, -1, rows, 2 * rows, 3).astype(np.uint16)
    digits = np.cumsum((high << 8) | low, axis=2, dtype=np.uint16) << _DROPPED
    steps = _decompressed(data["patterns"]).reshape(-1, side, side)
    return Ingredients(
        np.concatenate([colours.transpose(0, 3, 1, 2), covers], axis=1),
        digits.view(np.float16),
        np.cumsum(steps, axis=2, dtype=np.uint8),
    )


def _jpeg(cutout: np.ndarray) -> bytes:
    """The colours of a cut-out (4, side, side), continued outside the object."""
    weight = cutout[3:] / 255.0
    around = [
        ndimage.uniform_filter(one, (0, _BORDER, _BORDER)) for one in (cutout[:3] * weight, weight)
    ]
    mean = around[0] / np.maximum(around[1], 1e-6)
    colours = np.where(weight > 0, cutout[:3], mean).round().clip(0, 255).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(colours.transpose(1, 2, 0)).save(
        file, "JPEG", quality=_QUALITY, subsampling=0, optimize=True
    )
    return file.getvalue()


def _compressed(values: np.ndarray) -> np.ndarray:
    return np.frombuffer(lzma.compress(values.tobytes(), preset=6), np.uint8)


def _decompressed(stream: np.ndarray) -> np.ndarray:
    return np.frombuffer(lzma.decompress(stream.tobytes()), np.uint8)
