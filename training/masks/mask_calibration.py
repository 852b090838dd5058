"""Calibrate the confidence of a mask network on held-out composites.

  python -m training.masks.mask_calibration WORLD --panoramas DIR --weights NPZ -o MASK.npz

Equation: ridge logistic regression of "the photo shows one object, and the overlap (IoU) of the
mask is at least .5" on the features of `isc_core.masking.confidence`. Photos are those of part A of
`training.masks.held_out`; part B is the test set. The program prints a table of thresholds.

Citation: J. Platt, "Probabilistic outputs for support vector machines and comparisons to
regularized likelihood methods", 1999.

Limits: as many photos of one object as of none and several together.
"""

import argparse
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.io.npy import read_arrays
from isc_core.masking.finder import shows_several
from isc_core.masking.search import find_mask
from isc_core.networks.mask_network import Count, MaskNetwork

from .held_out import HeldOut, held_out_composites, held_out_ingredients

_RIDGE, _STEPS = 0.1, 50
_MIN_OVERLAP = 0.5  # of a correct mask
_THRESHOLDS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7)


def logistic_weights(features: np.ndarray, correct: np.ndarray) -> np.ndarray:
    """Fit a logistic regression by Newton's method.

    Parameters
    ----------
    features : (N, K) ndarray
    correct : (N,) bool ndarray

    Returns
    -------
    (K,) ndarray
    """
    weights = np.zeros(features.shape[1])
    for _ in range(_STEPS):
        share = 1 / (1 + np.exp(-features @ weights))
        gradient = features.T @ (share - correct) + _RIDGE * weights
        curvature = (features.T * (share * (1 - share))) @ features
        weights = weights - np.linalg.solve(curvature + _RIDGE * np.eye(len(weights)), gradient)
    return weights


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
        truth = photo.cover >= 0.5
        overlap = (found.mask & truth).sum() / max((found.mask | truth).sum(), 1)
        rows.append(found.features)
        correct.append(photo.count == Count.ONE and overlap >= _MIN_OVERLAP)
        single.append(bool(found.mask.any()) and not shows_several(found.mask))
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
    add("--count", type=int, default=480, help="photos (default: %(default)s)")
    add("--seed", type=int, default=0, help="of the photos (default: %(default)s)")
    add("-o", "--output", type=Path, required=True, metavar="NPZ", help="where to write it")
    given = parser.parse_args()
    try:
        arrays = read_arrays(given.weights)
        ingredients = held_out_ingredients(given.world, given.panoramas, "A", seed=given.seed)
        network = MaskNetwork.read(given.weights)
    except InputError as error:
        parser.error(str(error))
    numbers = ((Count.ONE, 2), (Count.NONE, 4), (Count.SEVERAL, 4))
    photos = [
        photo
        for kind, part in numbers
        for photo in held_out_composites(ingredients, kind, given.count // part, given.seed + 1)
    ]
    features, correct, single = observed(photos, network)
    weights = logistic_weights(features, correct)
    print("weights", np.round(weights, 3), "correct", correct.mean())
    confidence = 1 / (1 + np.exp(-features @ weights))
    one = np.array([photo.count for photo in photos]) == Count.ONE
    for limit in _THRESHOLDS:
        used = single & (confidence >= limit)
        print(
            f"{limit:.2f}: refuses {(~used)[one].mean():.1%} of single objects, "
            f"{(~used)[correct].mean():.1%} of correct masks; accepts {used[~one].mean():.1%} "
            "without a single object"
        )
    with new_file(given.output) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **{**arrays, "sureness": weights.astype(np.float32)})


if __name__ == "__main__":
    main()
