"""A sheet of one rendered scene: what the joint model separates that colour alone leaves.

  python -m benchmarks.decomposition.joint_sheet SCENE -o SHEET.jpg [--odds 1]

SCENE is the folder of a scene of `isc synth`. From left to right: the photo, the diffuse layer of
MDR, of the joint model, the true one, and the specular layer of the joint model, all in one
exposure. Printed is the squared error of diffuse layers over that of the photo itself, at `--odds`,
at the default odds and at 0.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

import isc_core
from isc_core.decomposition.settings import Settings
from isc_core.errors import InputError
from isc_core.imaging.bounding_box import mask_slices
from isc_core.io.atomic import new_file
from isc_core.scene.decomposition import Decomposition
from isc_core.separation import HIGHLIGHT_ODDS
from synth.capture.truth import GroundTruth
from synth.dataset.reading import read_truth

from .prediction_sheets import toned

_HEIGHT, _GAP = 260, 12  # pixels
_WHITE, _HEADROOM = 99.5, 1.15  # percentile of the true diffuse layer, and factor
_QUALITY = 85


def error_ratio(diffuse: np.ndarray, image: np.ndarray, true: np.ndarray) -> float:
    """Return the squared error of a diffuse layer over that of the photo.

    Parameters
    ----------
    diffuse, image, true : (N, 3) ndarray
        The layer, the photo and the true diffuse layer at the object's pixels.

    Returns
    -------
    float
        0 is perfect, 1 is the photo itself.
    """
    error, photo = (np.square(layer - true).sum(dtype=float) for layer in (diffuse, image))
    return float(error / photo)


def sheet(layers: Sequence[np.ndarray], mask: np.ndarray, white: float) -> Image.Image:
    """Lay layers out in one exposure, enlarged by a whole number.

    Parameters
    ----------
    layers : sequence of (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        The object.
    white : float
        Radiance that is shown white.

    Returns
    -------
    PIL.Image.Image
    """
    box = mask_slices(mask)
    rows = box[0].stop - box[0].start
    scale = max(1, round(_HEIGHT / rows))
    gap = np.full((scale * rows, _GAP, 3), 255, np.uint8)
    pictures = [
        toned(layer[box], mask[box], white).repeat(scale, 0).repeat(scale, 1) for layer in layers
    ]
    return Image.fromarray(np.hstack([part for one in pictures for part in (one, gap)][:-1]))


def decomposed(truth: GroundTruth, **settings: object) -> Decomposition:
    """Decompose the photo of a scene.

    Parameters
    ----------
    truth : GroundTruth
    **settings
        Of `Settings`.

    Returns
    -------
    Decomposition
    """
    return isc_core.decompose(truth.image, truth.mask, settings=Settings(**settings))  # type: ignore[arg-type]


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path, metavar="SCENE")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE")
    parser.add_argument("--odds", type=float, default=1.0, help="default: %(default)s")
    given = parser.parse_args()
    try:
        truth = read_truth(given.scene)
        inside = truth.mask
        mdr = decomposed(truth, model="mdr")
        found = {
            odds: decomposed(truth, highlight_odds=odds)
            for odds in dict.fromkeys((given.odds, HIGHLIGHT_ODDS, 0.0))
        }
        names = {"mdr": mdr, **{f"joint, odds {odds:g}": one for odds, one in found.items()}}
        for name, one in names.items():
            layers = (layer[inside] for layer in (one.diffuse, truth.image, truth.diffuse))
            print(f"{name}: {error_ratio(*layers):.3f}")
        joint = found[given.odds]
        shown = (truth.image, mdr.diffuse, joint.diffuse, truth.diffuse, joint.specular)
        white = _HEADROOM * float(np.percentile(truth.diffuse[inside], _WHITE))
        with new_file(given.output) as partial:
            sheet(shown, inside, white).save(partial, "JPEG", quality=_QUALITY, optimize=True)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
