"""Cut-outs of photographs with transparent backgrounds.

  python -m training.masks.photo_cutouts FOLDER -o POOL [--without NAME ...]

Problem: rendered objects are no animals or plants. Photographs of such things that somebody has cut
out can be pasted like rendered objects (`ingredients`).

FOLDER contains PNG files, at any depth. Drawings among them would teach flat colours and black
outlines. A file is taken for a photograph if at most .4 of the neighbouring opaque pixels have
equal colours: sensors have noise. Files with an object of less than 64 pixels, and files of which
more than a quarter is translucent, are left out, too, as are folders that --without names.
POOL/learned.npz is for training, POOL/judged.npz has part A of the held-out ones.

Splits: a quarter of the photographs is held out, half of them for each part of `held_out`. A hash
of the folder and the first word of the name decides, so that pictures of the same thing, such as a
mirrored one, stay together.

Limits: the cut-outs are as good as the person who made them. Things that no rule can tell from
photographs, such as shaded drawings, are kept.
"""

import argparse
import re
from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from zlib import crc32

import numpy as np
import torch
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.bounding_box import mask_box
from isc_core.imaging.srgb import srgb_to_linear

from .ingredients import SETS, SIDE, cut_out
from .packs import SUFFIX, Ingredients

_MAX_EQUAL = 0.4  # of neighbouring pixels
_MIN_LENGTH = 64  # pixels
_MAX_TRANSLUCENT = 0.25  # of the pixels
_OPAQUE, _CLEAR = 250, 5  # alpha
_PARTS = 8


class Part(StrEnum):
    """What a photograph may be used for."""

    TRAIN = "train"
    CHOICE = "A"
    TEST = "B"


@dataclass(frozen=True, eq=False)
class CutPhoto:
    """A photograph of something cut out.

    Attributes
    ----------
    path : Path
    codes : (H, W, 4) uint8 ndarray
        sRGB and alpha.
    part : Part
    """

    path: Path
    codes: np.ndarray
    part: Part

    def cutout(self, side: int = SIDE) -> np.ndarray | None:
        """Scale it to the size of cut-outs.

        Parameters
        ----------
        side : int
            Of a cut-out, pixels.

        Returns
        -------
        (4, side, side) uint8 ndarray or None
            As `packs.Ingredients.cutouts`; None if the object covers hardly anything of its frame.
        """
        values = self.codes / np.float32(255)
        layers = np.dstack([srgb_to_linear(values[..., :3]), values[..., 3]])
        planes = torch.from_numpy(layers).float().permute(2, 0, 1)[None]
        return next(cut_out(planes[:, :3], planes[:, 3:], side), None)


def read_cut_photos(folder: Path, without: Collection[str] = ()) -> list[CutPhoto]:
    """Read the photographs of a folder.

    Parameters
    ----------
    folder : Path
    without : collection of str
        Names of folders to leave out.

    Returns
    -------
    list of CutPhoto
        In the order of their paths.

    Raises
    ------
    InputError
        If there is none, or a file cannot be read.
    """
    found = []
    for path in sorted(folder.rglob("*.png")):
        inside = path.relative_to(folder)
        if not set(inside.parent.parts) & set(without):
            codes = _codes(path)
            if _is_photo(codes):
                found.append(CutPhoto(path, codes, _part_of(inside)))
    if not found:
        raise InputError(f"{folder}: no photographs with transparent backgrounds (PNG)")
    return found


def _codes(path: Path) -> np.ndarray:
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGBA"))
    except OSError as error:
        raise InputError(f"{path}: not a PNG that can be read: {error}") from error


def _is_photo(codes: np.ndarray) -> bool:
    alpha = codes[..., 3]
    opaque, covered = alpha >= _OPAQUE, alpha > _CLEAR
    pairs = opaque[:, 1:] & opaque[:, :-1]
    if covered.all() or not pairs.any():
        return False
    equal = (codes[:, 1:, :3] == codes[:, :-1, :3]).all(axis=2)[pairs].mean()
    translucent = (covered & ~opaque).sum() / covered.sum()
    length = max(mask_box(covered)[2:])
    return bool(length >= _MIN_LENGTH and equal <= _MAX_EQUAL and translucent <= _MAX_TRANSLUCENT)


def _part_of(inside: Path) -> Part:
    word = re.match("[a-z]*", inside.stem.lower())
    name = f"{inside.parent.as_posix()}/{word.group() if word else ''}"
    return {0: Part.CHOICE, 1: Part.TEST}.get(crc32(name.encode()) % _PARTS, Part.TRAIN)


def photo_cutouts(photos: list[CutPhoto], part: Part, side: int = SIDE) -> np.ndarray:
    """Return the cut-outs of one part.

    Parameters
    ----------
    photos : list of CutPhoto
    part : Part
    side : int
        Of a cut-out, pixels.

    Returns
    -------
    (N, 4, side, side) uint8 ndarray
        As `packs.Ingredients.cutouts`.

    Raises
    ------
    InputError
        If there is none.
    """
    made = [one.cutout(side) for one in photos if one.part == part]
    cutouts = [one for one in made if one is not None]
    if not cutouts:
        raise InputError(f"none of {len(photos)} photographs belongs to part {part}: add more")
    return np.stack(cutouts)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("folder", type=Path, metavar="FOLDER", help="PNG files with alpha channels")
    add("--without", nargs="*", default=[], metavar="NAME", help="folders to leave out")
    add("-o", "--output", type=Path, required=True, metavar="POOL", help="where to write")
    given = parser.parse_args()
    try:
        photos = read_cut_photos(given.folder, given.without)
        parts = [photo_cutouts(photos, part) for part in (Part.TRAIN, Part.CHOICE)]
    except InputError as error:
        parser.error(str(error))
    given.output.mkdir(parents=True, exist_ok=True)
    for name, cutouts in zip(SETS, parts, strict=True):
        made = Ingredients.of_cutouts(cutouts)
        path = given.output / f"{name}{SUFFIX}"
        print(f"{path}: {len(made.cutouts)} cut-outs, {made.write(path) / 1e6:.1f} MB", flush=True)


if __name__ == "__main__":
    main()
