"""A sheet of fine relief: crops of bodies at 1:1, without and with it, beside the truth.

  python -m benchmarks.detail.sheet SET BODY... -o SHEET.jpg [--side N]

SET is a folder of `benchmarks.detail.sets`, BODY a name such as `relief_03`. Each row has the
photo, normals without and with fine relief, reflectance without and with it, and true normals. The
crop lies where the true fine normals are strongest.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

import isc_core
from isc_core.decomposition.settings import MOST_DETAIL, Settings
from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.scene.decomposition import Decomposition

from ..decomposition.prediction_sheets import coloured, toned
from .measure import fine_normals
from .sets import PHOTO, Truth, read_truth

QUALITY = 85  # of JPEG
_SIDE, _GAP = 200, 4


def side_by_side(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Put pictures beside each other, with white gaps.

    Parameters
    ----------
    pictures : sequence of (H, W, 3) uint8 ndarray

    Returns
    -------
    (H, ..., 3) uint8 ndarray
    """
    gap = np.full((len(pictures[0]), _GAP, 3), 255, np.uint8)
    return np.hstack([part for picture in pictures for part in (picture, gap)][:-1])


def stacked(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Put rows below each other, with white gaps.

    Parameters
    ----------
    rows : sequence of (H, W, 3) uint8 ndarray

    Returns
    -------
    (..., W, 3) uint8 ndarray
    """
    gap = np.full((_GAP, rows[0].shape[1], 3), 255, np.uint8)
    return np.vstack([part for row in rows for part in (row, gap)][:-1])


def row_of(body: Path, side: int) -> np.ndarray:
    """Make the row of a body.

    Parameters
    ----------
    body : Path
        Its folder.
    side : int
        Of the crops, pixels.

    Returns
    -------
    (side, ..., 3) uint8 ndarray
    """
    truth = read_truth(body)
    without, with_relief = (
        isc_core.decompose(body / PHOTO, settings=Settings(max_size=0, detail=detail))
        for detail in (0, MOST_DETAIL)
    )
    crop = _strongest(truth, side)
    mask = truth.mask[crop]
    pictures = [toned(without.image[crop], mask)]
    pictures += [coloured(d.normal[crop], mask) for d in (without, with_relief)]
    pictures += [_reflectance(d, crop) for d in (without, with_relief)]
    pictures.append(coloured(truth.normal[crop], mask))
    return side_by_side(pictures)


def _reflectance(d: Decomposition, crop: tuple[slice, slice]) -> np.ndarray:
    return toned(d.reflectance[crop], d.mask[crop])


def _strongest(truth: Truth, side: int) -> tuple[slice, slice]:
    energy = np.square(fine_normals(truth.normal, truth.mask)).sum(axis=(0, 3))
    inside = ndimage.uniform_filter(truth.mask.astype(float), side, mode="constant") > 0.999
    mean = np.where(inside, ndimage.uniform_filter(energy, side, mode="constant"), -1)
    row, column = np.unravel_index(int(mean.argmax()), mean.shape)
    top, left = (
        int(np.clip(centre - side // 2, 0, size - side))
        for centre, size in zip((row, column), mean.shape, strict=True)
    )
    return slice(top, top + side), slice(left, left + side)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, metavar="SET")
    parser.add_argument("bodies", nargs="+", metavar="BODY")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE")
    parser.add_argument("--side", type=int, default=_SIDE, help="pixels (default: %(default)s)")
    given = parser.parse_args()
    try:
        rows = [row_of(given.folder / name, given.side) for name in given.bodies]
        with new_file(given.output) as partial:
            Image.fromarray(stacked(rows)).save(partial, "JPEG", quality=QUALITY)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
