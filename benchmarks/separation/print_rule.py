"""Fit the weights by which colour and form decide what was a highlight.

  python -m benchmarks.separation.print_rule NEW WORLD --panoramas DIR [--count N] [--seed N]
  [--mixed]

NEW and WORLD are folders of `isc world build`. Regions of light that colour and network remove from
the bodies of NEW that no network has learned from (`Part.TRAINING`), matt and glossy, are divided
into those whose removal lowers the squared error and those whose removal raises it. Logistic
regression, each region with the root of its squared light over that of its photo as weight, gives
weights as `highlight_evidence.WEIGHTS`. Their log loss on bodies that a fit has not seen is printed
beside that of the shipped weights. For the bodies of WORLD in `Part.VALIDATION` it prints what each
of `ODDS` costs and gains with either weights; `prints` reports on others. With --mixed, as many
bodies without print are added to both parts. The shipped weights were fitted with a former network,
on bodies that it had learned from.

    isc world build -o NEW --built 17000 --families 1200 --count 1200 --views 1
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchmarks.bootstrap import bootstrap_samples, interval
from isc_core.decomposition.joint import detect_residual_highlights
from isc_core.errors import InputError
from isc_core.networks.scene_network import predict_scene
from isc_core.numerics.logistic import logistic_weights
from isc_core.separation import COLOUR_ALONE, separate
from isc_core.separation.support.highlight_evidence import WEIGHTS, highlight_evidence

from .print_set import Part, PrintScene, print_scenes

ODDS = (1.5, 2.0, 3.0, 4.0, 6.0)
_RIDGE = 0.01
_FOLDS = 5


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions of light taken off one photo, K of them.

    Attributes
    ----------
    body : str
        Name of the body.
    values : (K, 3) ndarray
        Of `highlight_evidence.Evidence`.
    light, squares : (K,) ndarray
        Light taken off over that of the photo; the same of squares.
    gain : (K,) ndarray
        By how much the squared error falls, over the photo's squares.
    specular : float
        True specular light, squared, over the photo's squares; 0 for a matt body.
    """

    body: str
    values: np.ndarray
    light: np.ndarray
    squares: np.ndarray
    gain: np.ndarray
    specular: float


def regions_of(scene: PrintScene) -> Regions:
    """Separate a photo, and describe each region that would lose light.

    Parameters
    ----------
    scene : PrintScene

    Returns
    -------
    Regions
    """
    photo, mask, inside = scene.photo, scene.mask, scene.mask[..., None]
    seen = predict_scene(photo, mask)
    diffuse = separate("isc", photo, mask, scene.clipped, changes=COLOUR_ALONE).diffuse
    residual = detect_residual_highlights(photo, diffuse, mask, seen)
    diffuse = diffuse if residual is None else residual.diffuse
    form = seen.log_ratio, seen.ratio_scale
    found = highlight_evidence(photo, diffuse, mask, *form, scene.clipped)
    removed, truth = (
        np.where(inside, photo - one, 0).astype(float) for one in (diffuse, scene.diffuse)
    )
    squares, fall = np.square(removed), np.square(truth) - np.square(removed - truth)

    def sums(values: np.ndarray) -> np.ndarray:
        return np.asarray(ndimage.sum(values.sum(axis=2), found.labels, found.numbers), float)

    whole, power = float(photo[mask].sum()), float(np.square(photo[mask]).sum())
    specular = float(np.square(truth).sum()) / power
    return Regions(
        scene.body,
        found.values,
        sums(removed) / whole,
        sums(squares) / power,
        sums(fall) / power,
        specular,
    )


def fitted(photos: Sequence[Regions]) -> np.ndarray:
    """Fit the weights of standardised values, with a ridge.

    Parameters
    ----------
    photos : sequence of Regions

    Returns
    -------
    (4,) ndarray
        The constant first.
    """
    values = np.vstack([one.values for one in photos])
    good, share = _good_and_share(photos)
    mean, deviation = values.mean(axis=0), values.std(axis=0)
    rows = np.column_stack([np.ones(len(values)), (values - mean) / deviation])
    ridge = _RIDGE * len(values) * (np.arange(rows.shape[1]) > 0)
    weights = logistic_weights(rows, good, ridge, share)
    scaled = weights[1:] / deviation
    return np.concatenate([[weights[0] - scaled @ mean], scaled])


def _good_and_share(photos: Sequence[Regions]) -> tuple[np.ndarray, np.ndarray]:
    """Whether a removal lowers the error (K,) bool, and the weight (K,) of a region, mean 1."""
    share = np.sqrt(np.concatenate([one.squares for one in photos]))
    return np.concatenate([one.gain for one in photos]) > 0, share / share.mean()


def cross_validated_losses(photos: Sequence[Regions]) -> np.ndarray:
    """Compare fitted weights with the shipped ones on bodies that the fit has not seen.

    Parameters
    ----------
    photos : sequence of Regions
        Of `_FOLDS` bodies or more.

    Returns
    -------
    (B, 2) ndarray
        Of each body the weighted log loss, fitted and shipped; columns sum to means of regions.
    """
    bodies = sorted({one.body for one in photos})
    order = np.random.default_rng(0).permutation(len(bodies)) % _FOLDS
    fold = np.array([order[bodies.index(one.body)] for one in photos])
    numbers = np.concatenate([[bodies.index(one.body)] * len(one.gain) for one in photos])
    score = [np.zeros(0)] * len(photos)
    for k in range(_FOLDS):
        weights = fitted([one for one, part in zip(photos, fold, strict=True) if part != k])
        for j in np.flatnonzero(fold == k):
            score[j] = weights[0] + photos[j].values @ weights[1:]
    shipped = np.concatenate([WEIGHTS[0] + one.values @ WEIGHTS[1:] for one in photos])
    good, share = _good_and_share(photos)
    both = (np.concatenate(score), shipped)
    losses = [np.logaddexp(0, np.where(good, -one, one)) * share / share.sum() for one in both]
    return np.column_stack(
        [np.bincount(numbers.astype(int), one, minlength=len(bodies)) for one in losses]
    )


def loss_line(losses: np.ndarray) -> str:
    """Format the losses, with a 95 % interval of the difference over resampled bodies.

    Parameters
    ----------
    losses : (B, 2) ndarray
        Of `cross_validated_losses`.

    Returns
    -------
    str
    """
    apart = losses[:, 0] - losses[:, 1]
    low, high = interval(bootstrap_samples(apart).sum(axis=1))
    new, shipped = losses.sum(axis=0)
    return (
        f"log loss on other bodies: fitted {new:.4f}, shipped {shipped:.4f}; "
        f"difference {apart.sum():+.4f} ({low:+.4f} to {high:+.4f})"
    )


def kept(photos: Sequence[Regions], weights: np.ndarray, odds: float) -> tuple[float, float, float]:
    """Apply weights and odds.

    Parameters
    ----------
    photos : sequence of Regions
    weights : (4,) ndarray
    odds : float

    Returns
    -------
    worst_share : float
        Of the light of a matt body.
    mean_ratio, worst_ratio : float
        Squared error over that of doing nothing, of the glossy ones.
    """
    shares, ratios = [0.0], []
    for one in photos:
        accepted = weights[0] + one.values @ weights[1:] > np.log(odds)
        if one.specular > 0:
            ratios.append(1 - float(one.gain[accepted].sum()) / one.specular)
        else:
            shares.append(float(one.light[accepted].sum()))
    return max(shares), float(np.mean(ratios)), max(ratios)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("new", type=Path, metavar="NEW", help="world with bodies new to networks")
    parser.add_argument("world", type=Path, metavar="WORLD", help="world of the held-out bodies")
    parser.add_argument("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    parser.add_argument("--count", type=int, default=140, help="photos (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the photos (default: %(default)s)")
    parser.add_argument("--mixed", action="store_true", help="with bodies without print")
    given = parser.parse_args()
    try:
        training, validation = (
            [
                regions_of(scene)
                for painted in ((True, False) if given.mixed else (True,))
                for glossy in (False, True)
                for scene in print_scenes(
                    world, given.panoramas, part, count, glossy, painted=painted, seed=given.seed
                )
            ]
            for world, part, count in (
                (given.new, Part.TRAINING, given.count),
                (given.world, Part.VALIDATION, 60),
            )
        )
    except InputError as error:
        parser.error(str(error))
    weights = fitted(training)
    print("weights", *weights.round(3))
    print(loss_line(cross_validated_losses(training)))
    for name, tried in (("fitted", weights), ("shipped", np.array(WEIGHTS))):
        for odds in ODDS:
            share, mean, worst = kept(validation, tried, odds)
            print(
                f"{name}, odds {odds}: matt, worst {share:.2%}; "
                f"glossy, mean {mean:.3f}, worst {worst:.3f}"
            )


if __name__ == "__main__":
    main()
