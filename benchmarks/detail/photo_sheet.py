"""A sheet of fine relief on real photos: crops at 1:1, without and with it.

  python -m benchmarks.detail.photo_sheet -o SHEET.jpg [--side N] --row WITHOUT WITH X,Y [--row ...]

WITHOUT and WITH are result folders of one photo, of `isc decompose --max-size 0 --detail 0` and
`--detail 4096`; X,Y is the crop's top left pixel. Each row has the photo, normals without and with
fine relief, and reflectance without and with it. Printed are, for each crop, the fine changes of
the normals with relief, their root mean square in degrees,

    sqrt(mean |m|^2),   m = (n_with - n_without) - G (n_with - n_without),

and how much fine contrast of the reflectance is left, std(f_with) / std(f_without), where f is the
log of the mean channel less its G, a Gaussian of 4 pixels.

Limits: a photo has no true normals. Both figures show how much relief was added, not whether it is
right.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.smoothing import masked_gaussian
from isc_core.io.atomic import new_file
from isc_core.result_files.result_folder import load
from isc_core.scene.decomposition import Decomposition

from ..decomposition.prediction_sheets import coloured, toned
from .sheet import QUALITY, side_by_side, stacked

_SIDE = 170  # pixels
_SIGMA = 4.0  # pixels: fine changes are shorter
_DARK = 1e-3  # of the mean reflectance


@dataclass(frozen=True, eq=False)
class Crop:
    """The part of a result that a sheet shows.

    Attributes
    ----------
    image, normal, reflectance : (N, N, 3) ndarray
        As in the result.
    mask : (N, N) ndarray of bool
    """

    image: np.ndarray
    normal: np.ndarray
    reflectance: np.ndarray
    mask: np.ndarray

    @classmethod
    def of(cls, result: Decomposition, corner: tuple[int, int], side: int) -> "Crop":
        """Cut a crop out.

        Parameters
        ----------
        result : Decomposition
        corner : (int, int)
            x and y of its top left pixel.
        side : int
            Pixels.

        Returns
        -------
        Crop

        Raises
        ------
        InputError
            If it reaches beyond the maps, or has no pixel of the object.
        """
        x, y = corner
        height, width = result.mask.shape
        if not (0 <= x <= width - side and 0 <= y <= height - side):
            raise InputError(
                f"a crop of {side} pixels at {x},{y} is not inside the maps, which have {width} x "
                f"{height} pixels: choose a smaller X,Y or --side"
            )
        here = slice(y, y + side), slice(x, x + side)
        if not result.mask[here].any():
            raise InputError(f"the crop at {x},{y} has no pixel of the object: choose another X,Y")
        # Copies: the maps of a large photo are not kept.
        return cls(
            result.image[here].copy(),
            result.normal[here].copy(),
            result.reflectance[here].copy(),
            result.mask[here].copy(),
        )


def row_of(without: Crop, with_relief: Crop) -> np.ndarray:
    """Make the row of a photo.

    Parameters
    ----------
    without, with_relief : Crop
        The same part of both results.

    Returns
    -------
    (N, ..., 3) uint8 ndarray
    """
    both = (without, with_relief)
    return side_by_side(
        [
            toned(with_relief.image, with_relief.mask),
            *(coloured(one.normal, one.mask) for one in both),
            *(toned(one.reflectance, one.mask) for one in both),
        ]
    )


def added(without: Crop, with_relief: Crop) -> tuple[float, float]:
    """Measure how much relief was added.

    Parameters
    ----------
    without, with_relief : Crop
        The same part of both results.

    Returns
    -------
    angle : float
        Root mean square of the fine changes of the normals, degrees.
    contrast : float
        Fine contrast of the reflectance over that without relief; 1: unchanged.
    """
    mask = without.mask & with_relief.mask
    moved = with_relief.normal - without.normal
    fine = np.stack([_fine(one, mask) for one in moved.transpose(2, 0, 1)])
    angle = np.degrees(np.sqrt(np.square(fine).sum(axis=0)[mask].mean(dtype=float)))
    before, after = (float(_fine(_log(one), mask)[mask].std()) for one in (without, with_relief))
    return float(angle), after / max(before, 1e-9)


def _log(crop: Crop) -> np.ndarray:
    mean = crop.reflectance.mean(axis=2)
    return np.log(mean + _DARK * max(float(mean[crop.mask].mean()), 1e-9))


def _fine(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    inside = np.where(mask, values, 0)
    return np.where(mask, inside - masked_gaussian(inside, mask, _SIGMA), 0)


def _corner(text: str) -> tuple[int, int]:
    x, comma, y = text.partition(",")
    if not (comma and x.isdecimal() and y.isdecimal()):
        raise InputError(f"{text!r} is not X,Y: give two whole numbers of pixels, such as 900,1200")
    return int(x), int(y)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--row", nargs=3, action="append", required=True, metavar=("WITHOUT", "WITH", "X,Y")
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE")
    parser.add_argument("--side", type=int, default=_SIDE, help="pixels (default: %(default)s)")
    given = parser.parse_args()
    try:
        rows = []
        for *folders, corner in given.row:
            crops = [Crop.of(load(folder), _corner(corner), given.side) for folder in folders]
            rows.append(row_of(*crops))
            angle, contrast = added(*crops)
            print(f"{folders[1]} at {corner}: {angle:.1f} degrees, contrast {contrast:.2f}")
        with new_file(given.output) as partial:
            Image.fromarray(stacked(rows)).save(partial, "JPEG", quality=QUALITY)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
