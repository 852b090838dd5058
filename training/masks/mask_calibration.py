"""Calibrate the confidence of a mask network on held-out composites.

  python -m training.masks.mask_calibration WORLD --panoramas DIR --weights NPZ
  [--tabletops FOLDER] -o MASK.npz

Equation: ridge logistic regression of "the mask is correct" on the features of
`isc_core.masking.confidence`. A mask of one object is correct if its overlap (IoU) is at least .5.
A mask of several is correct if it is in one piece, and its overlap with all of them is at least .7:
a pile. Photos are those of part A of `training.masks.held_out`; part B is the test set. Two of
three photos of one object are difficult. The program prints a table of thresholds.

Citation: J. Platt, "Probabilistic outputs for support vector machines and comparisons to
regularized likelihood methods", 1999.

Limits: three composites of one object for two of none or several.
"""

import argparse
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.io.atomic import new_file, require_writable_file
from isc_core.io.npy import read_arrays
from isc_core.masking.components import shows_several
from isc_core.masking.confidence import mask_overlap
from isc_core.masking.search import find_mask
from isc_core.networks.mask_network import Count, MaskNetwork
from isc_core.numerics.logistic import logistic_weights

from .difficulty import SIMPLE, Difficulty
from .held_out import (
    HeldOut,
    held_out_composites,
    held_out_ingredients,
    held_out_tabletops,
)

_RIDGE = 0.1
_MIN_OVERLAP = {Count.ONE: 0.5, Count.SEVERAL: 0.7}  # of a correct mask
_KINDS = (  # of photos, and their shares
    (Count.ONE, SIMPLE, 1 / 4),
    (Count.ONE, Difficulty(compound=1), 1 / 12),
    (Count.ONE, Difficulty(cut=1), 1 / 12),
    (Count.ONE, Difficulty(defocused=1), 1 / 12),
    (Count.ONE, Difficulty(banded=1), 1 / 12),
    (Count.NONE, SIMPLE, 1 / 8),
    (Count.NONE, Difficulty(defocused=1), 1 / 16),
    (Count.SEVERAL, SIMPLE, 1 / 6),
    (Count.SEVERAL, Difficulty(defocused=1, banded=0.3), 1 / 16),
)
_FIRST_SEED = 40
_THRESHOLDS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7)


def observed(
    photos: list[HeldOut], network: MaskNetwork
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the mask of each photo, and compare it with the ground truth.

    Parameters
    ----------
    photos : list of HeldOut
    network : MaskNetwork

    Returns
    -------
    features : (N, FEATURES) ndarray
        Of the confidence.
    correct : (N,) bool ndarray
    single : (N,) bool ndarray
        False where the mask is empty or shows several objects: it is refused at any confidence.
    """
    rows, correct, single = [], [], []
    for photo in photos:
        found = find_mask(photo.light, network=network)
        overlap = mask_overlap(found.mask, photo.cover >= 0.5)
        rows.append(found.features)
        single.append(bool(found.mask.any()) and not shows_several(found.mask))
        alone = photo.count == Count.ONE or single[-1]
        correct.append(alone and overlap >= _MIN_OVERLAP.get(photo.count, np.inf))
    return np.array(rows), np.array(correct), np.array(single)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--weights", type=Path, required=True, metavar="NPZ", help="weights to calibrate")
    add("--tabletops", type=Path, metavar="FOLDER", help="rendered pictures, added to the photos")
    add("--count", type=int, default=480, help="composites (default: %(default)s)")
    add("--seed", type=int, default=0, help="of the photos (default: %(default)s)")
    add("-o", "--output", type=Path, required=True, metavar="NPZ", help="where to write it")
    given = parser.parse_args()
    try:
        require_writable_file(given.output)
        arrays, network = read_arrays(given.weights), MaskNetwork.read(given.weights)
        ingredients = held_out_ingredients(given.world, given.panoramas, "A", seed=given.seed)
        folder = given.tabletops
        tabletops = [] if folder is None else list(held_out_tabletops(folder, given.seed))
    except InputError as error:
        parser.error(str(error))
    photos = [
        photo
        for k, (count, difficulty, share) in enumerate(_KINDS)
        for photo in held_out_composites(
            ingredients,
            count,
            round(given.count * share),
            given.seed + _FIRST_SEED + k,
            difficulty,
        )
    ]
    photos += tabletops
    features, correct, single = observed(photos, network)
    weights = logistic_weights(features, correct, _RIDGE)
    print("weights", np.round(weights, 3), "correct", correct.mean())
    confidence = 1 / (1 + np.exp(-features @ weights))
    one = np.array([photo.count for photo in photos]) == Count.ONE
    for limit in _THRESHOLDS:
        used = single & (confidence >= limit)
        print(
            f"{limit:.2f}: refuses {(~used)[one].mean():.1%} of single objects, "
            f"{(~used)[one & correct].mean():.1%} of correct masks; accepts "
            f"{used[~one].mean():.1%} without a single object, "
            f"{(used & ~correct)[~one].mean():.1%} that are no piles"
        )
    with new_file(given.output) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **{**arrays, "sureness": weights.astype(np.float32)})


if __name__ == "__main__":
    main()
