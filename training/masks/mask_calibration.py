"""Calibrate the confidence of a mask network on held-out composites.

  python -m training.masks.mask_calibration WORLD --panoramas DIR --weights NPZ -o MASK.npz

Equation: logistic regression of "the photo shows one object, and the mask overlaps it by .5 or
more" on `isc_core.masking.confidence`, with a small ridge. Photos are those of part A of
`training.masks.held_out`; part B is the test set. A table of thresholds follows.

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
_RIGHT = 0.5  # overlap of a mask that counts as right
_THRESHOLDS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7)


def logistic_weights(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Fit a logistic regression by Newton's method.

    Parameters
    ----------
    features : (N, K) ndarray
    right : (N,) bool ndarray

    Returns
    -------
    (K,) ndarray
    """
    weights = np.zeros(features.shape[1])
    for _ in range(_STEPS):
        share = 1 / (1 + np.exp(-features @ weights))
        gradient = features.T @ (share - right) + _RIDGE * weights
        curvature = (features.T * (share * (1 - share))) @ features
        weights = weights - np.linalg.solve(curvature + _RIDGE * np.eye(len(weights)), gradient)
    return weights


def observed(
    photos: list[HeldOut], network: MaskNetwork
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the evidence of each photo, whether its mask is right, and whether it may be used.

    Parameters
    ----------
    photos : list of HeldOut
    network : MaskNetwork

    Returns
    -------
    evidence : (N, FEATURES) ndarray
    right : (N,) bool ndarray
    whole : (N,) bool ndarray
        False where the mask shows nothing or several objects: it is refused at any confidence.
    """
    rows, right, whole = [], [], []
    for photo in photos:
        found = find_mask(photo.light, network=network)
        truth = photo.cover >= 0.5
        overlap = (found.mask & truth).sum() / max((found.mask | truth).sum(), 1)
        rows.append(found.features)
        right.append(photo.count == Count.ONE and overlap >= _RIGHT)
        whole.append(bool(found.mask.any()) and not shows_several(found.mask))
    return np.array(rows), np.array(right), np.array(whole)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--weights", type=Path, required=True, metavar="NPZ", help="what was fitted")
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
    evidence, right, whole = observed(photos, network)
    weights = logistic_weights(evidence, right)
    print("weights", np.round(weights, 3), "right", right.mean())
    confidence = 1 / (1 + np.exp(-evidence @ weights))
    one = np.array([photo.count for photo in photos]) == Count.ONE
    for limit in _THRESHOLDS:
        used = whole & (confidence >= limit)
        print(
            f"{limit:.2f}: refuses {(~used)[one].mean():.1%} of single objects, "
            f"{(~used)[right].mean():.1%} of right masks; accepts {used[~one].mean():.1%} without "
            "a single object"
        )
    with new_file(given.output) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **{**arrays, "sureness": weights.astype(np.float32)})


if __name__ == "__main__":
    main()
