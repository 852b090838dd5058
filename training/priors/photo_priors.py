"""Fit the priors of photos: `isc_core/sirfs/priors/data/photo.npz`.

  python -m training.priors.photo_priors WORLD --panoramas DIR -o photo.npz [--bodies N]
  [--photos N] [--seed K]

WORLD is a folder of `isc world build`: its training bodies of seeds are made again at the solver's
size and painted with its patterns (`photographed_bodies`). Panoramas that are not held out are
photographed (`panorama_photos`). Nothing else goes into the file: no measured object, no
research-only data.

The program prints what white balance leaves, and the median log likelihood of lights, brightness
aside, under the new prior and under that of MIT-Berkeley's natural light.

Limits: those of the two modules.
"""

import argparse
import contextlib
from pathlib import Path

import numpy as np

from isc_core.errors import InputError
from isc_core.prior_fitting.fit import SYNTHETIC, fit_photo_priors
from isc_core.prior_fitting.statistics import ObjectStatistics, object_statistics
from isc_core.sirfs.priors.lights import GaussianLight, stacked
from isc_core.sirfs.priors.prior_file import save_prior_set, shipped_prior_set

from ..world.files import read_patterns
from .panorama_photos import PanoramaPhoto, photograph, read_pictures
from .photographed_bodies import Painter, made_bodies, read_settings, training_object

_AXES = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])


def body_statistics(world: Path, count: int, seed: int) -> dict[str, ObjectStatistics]:
    """Condense bodies of a world.

    Parameters
    ----------
    world : Path
    count : int
        Bodies to try; those that cannot be made or cover too little are left out.
    seed : int

    Returns
    -------
    dict of str to ObjectStatistics

    Raises
    ------
    InputError
        If the folder is no world.
    """
    painter, found = Painter(read_patterns(world)), {}
    for k, reference in enumerate(made_bodies(*read_settings(world), count, seed)):
        body = training_object(reference, painter, np.random.default_rng([seed, k]))
        if body is None:
            continue
        with contextlib.suppress(InputError):  # nothing of it is smooth, or all of it is clipped
            found[reference.name] = object_statistics(body)
    return found


def photos_of(
    panoramas: Path, each: int, seed: int
) -> tuple[list[PanoramaPhoto], list[PanoramaPhoto]]:
    """Photograph panoramas.

    Parameters
    ----------
    panoramas : Path
    each : int
        Photos of a panorama.
    seed : int

    Returns
    -------
    training, held_out : list of PanoramaPhoto

    Raises
    ------
    InputError
        If the panoramas cannot be read.
    """
    rngs = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    training, held_out = list[PanoramaPhoto](), list[PanoramaPhoto]()
    for panorama, radiance in read_pictures(panoramas):
        into, rng = (held_out, rngs[1]) if panorama.held_out else (training, rngs[0])
        into += [photograph(panorama, radiance, rng) for _ in range(each)]
    return training, held_out


def describe_balance(title: str, photos: list[PanoramaPhoto]) -> str:
    """Describe what white balance leaves.

    Parameters
    ----------
    title : str
    photos : list of PanoramaPhoto

    Returns
    -------
    str
    """
    parts = []
    for name in ("unbalanced", "cast"):
        colour = np.array([getattr(photo, name) for photo in photos])
        length = np.linalg.norm(colour, axis=1) * np.sqrt(3)
        angle = np.degrees(np.arccos(np.clip(colour.sum(axis=1) / length, -1, 1)))
        axes = np.quantile(np.abs(np.log(colour) @ _AXES.T), 0.68, axis=0)
        channel = np.quantile(np.abs(np.log(colour)), 0.68, axis=0)
        parts.append(
            f"{name}: angle median {np.median(angle):.1f}, 90 % {np.quantile(angle, 0.9):.1f}; "
            f"68 % within {axes[0]:.3f} red-green, {axes[1]:.3f} blue-yellow, "
            f"{channel[0]:.3f} {channel[1]:.3f} {channel[2]:.3f} by channel"
        )
    return "\n".join(f"{title}, {part}" for part in parts)


def log_likelihoods(prior: GaussianLight, photos: list[PanoramaPhoto]) -> np.ndarray:
    """Compute how likely lights are, whatever their brightness.

    Parameters
    ----------
    prior : GaussianLight
    photos : list of PanoramaPhoto

    Returns
    -------
    (n,) ndarray
        Log density over the 26 coefficients across brightness.
    """
    bright = np.zeros((1, len(prior.mean)))
    bright[0, ::9] = 1
    across = np.linalg.svd(bright)[2][1:]
    part = GaussianLight(across @ prior.mean, across @ prior.covariance @ across.T)
    lights = stacked(np.array([photo.light for photo in photos]))
    return part.log_likelihood(lights @ across.T)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--bodies", type=int, default=120, metavar="N", help="default: %(default)s")
    add("--photos", type=int, default=60, metavar="N", help="of a panorama (default: %(default)s)")
    add("--seed", type=int, default=0, metavar="K", help="default: %(default)s")
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="the file to write")
    given = parser.parse_args()
    try:
        training, held_out = photos_of(given.panoramas, given.photos, given.seed)
        for title, photos in (("training", training), ("held out", held_out)):
            print(describe_balance(title, photos), flush=True)
        statistics = body_statistics(given.world, given.bodies, given.seed)
        found = fit_photo_priors(
            statistics, np.array([photo.light for photo in training]), SYNTHETIC
        )
        save_prior_set(given.output, found)
    except InputError as error:
        parser.error(str(error))
    natural = shipped_prior_set("natural").lights.natural
    for name, prior in (("photo", found.lights.photo), ("natural", natural)):
        if prior is not None:
            likely = [np.median(log_likelihoods(prior, photos)) for photos in (training, held_out)]
            print(
                f"log likelihood, median, {name}: training {likely[0]:.1f}, "
                f"held out {likely[1]:.1f}"
            )
    print(f"{given.output}: priors of {len(statistics)} bodies and {len(training)} photos")


if __name__ == "__main__":
    main()
