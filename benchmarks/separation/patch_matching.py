"""How good and how fast is Coherency Sensitive Hashing, against comparing all pairs of patches?

  python -m benchmarks.separation.patch_matching [PHOTO ...] [--megapixels .5] [--sample 2000] [--tables 8]

For each photo (enlarged or reduced to the size asked for; without one, a made-up texture): patches
of a turned, enlarged and noisy copy are matched to those of the photo ("later view"), and patches
of its right half to those of its left ("halves"). The exhaustive search goes through all source
patches for a random sample of target patches by one matrix product (BLAS, float32, all cores); its
time for all target patches is extrapolated from the sample. Distances of the matches are exact in
both. Every time is the wall's; the compiler has run before.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from isc_core.inpainting.coherency_sensitive_hashing import (
    CshOptions,
    CshSearch,
    Patches,
    patches_within,
)
from isc_core.photo.photo import read_photo

# Source patches that the exhaustive search compares at once: the products fit a processor's cache
# then.
_BLOCK = 4096


@dataclass(frozen=True)
class Comparison:
    """Of one pair of images: megapixels of the sources, seconds of both searches, mean distance and
    mean squared distance of the found matches over those of the best ones, and the share of sampled
    patches whose match is a best one.
    """

    name: str
    megapixels: float
    exhaustive: float
    hashing: float
    distance: float
    squared: float
    best: float


def made_up(height: int, width: int) -> np.ndarray:
    """A texture (height, width, 3) with shapes of all sizes and edges."""
    rng = np.random.default_rng(1)
    image = np.zeros((height, width, 3))
    for sigma in (1.0, 3.0, 9.0, 27.0):
        noise = ndimage.gaussian_filter(
            rng.normal(size=image.shape), (sigma, sigma, 0), mode="wrap"
        )
        image += np.sign(noise) * np.abs(noise / noise.std()) ** 0.3
    return np.clip(0.5 + 0.1 * image, 0, 1)


def seen_later(image: np.ndarray) -> np.ndarray:
    """The same scene, turned by 4 degrees, enlarged by 4 % and with noise of half a percent."""
    turn = (
        np.array([[np.cos(0.07), np.sin(0.07), 0], [-np.sin(0.07), np.cos(0.07), 0], [0, 0, 1.04]])
        / 1.04
    )
    moved = ndimage.affine_transform(
        image, turn, offset=(0.01 * len(image), 0.01 * len(image), 0), order=1, mode="reflect"
    )
    return moved + 0.005 * np.random.default_rng(9).normal(size=image.shape)


def resized(image: np.ndarray, megapixels: float) -> np.ndarray:
    """`image` (H, W, 3) with about so many pixels."""
    factor = float(np.sqrt(megapixels * 1e6 / (image.shape[0] * image.shape[1])))
    return np.clip(ndimage.zoom(image, (factor, factor, 1), order=3 if factor > 1 else 1), 0, None)


def vectors(patches: Patches, first: int, last: int, which: np.ndarray | None = None) -> np.ndarray:
    """The patches `which`, or those of [first, last), as rows (n, 64 C)."""
    chosen = np.arange(first, min(last, len(patches))) if which is None else which
    rows, columns = patches.rows[chosen], patches.columns[chosen]
    return np.stack(
        [patches.image[rows + a, columns + b] for a in range(8) for b in range(8)], axis=1
    ).reshape(len(chosen), -1)


def exhaustive(source: Patches, target: Patches, sample: np.ndarray) -> tuple[np.ndarray, float]:
    """Squared distances (n,) to the best source patch of the target patches `sample`, and the
    seconds that took.
    """
    wanted = vectors(target, 0, 0, sample)
    best, where = np.full(len(sample), np.inf, np.float32), np.zeros(len(sample), np.intp)
    start = time.perf_counter()
    for first in range(0, len(source), _BLOCK):
        block = vectors(source, first, first + _BLOCK)
        half = 0.5 * np.einsum("ij,ij->i", block, block) - wanted @ block.T
        nearest = np.argmin(half, axis=1)
        value = half[np.arange(len(sample)), nearest]
        better = value < best
        best[better], where[better] = value[better], first + nearest[better]
    seconds = time.perf_counter() - start
    # Once more for the winners: differences of large numbers are too rough for the distances
    # themselves.
    return ((wanted.astype(np.float64) - vectors(source, 0, 0, where)) ** 2).sum(axis=1), seconds


def compare(
    name: str, first: np.ndarray, second: np.ndarray, sample: int, options: CshOptions
) -> Comparison:
    """Both searches for patches of `second` among those of `first`."""
    source, target = (
        patches_within(image, np.ones(image.shape[:2], bool)) for image in (first, second)
    )
    start = time.perf_counter()
    matches = CshSearch(source, options).match(target)
    hashing = time.perf_counter() - start
    which = np.random.default_rng(2).choice(len(target), min(sample, len(target)), replace=False)
    best, seconds = exhaustive(source, target, which)
    found = matches.distance[which].astype(np.float64)
    return Comparison(
        name,
        first.shape[0] * first.shape[1] / 1e6,
        seconds * len(target) / len(which),
        hashing,
        float(np.sqrt(found).mean() / np.sqrt(best).mean()),
        float(found.mean() / best.mean()),
        float((found <= best * 1.0001 + 1e-12).mean()),
    )


def main() -> None:
    """Prints one row for each pair of images."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photos", nargs="*", type=Path)
    parser.add_argument("--megapixels", type=float, default=0.5)
    parser.add_argument("--sample", type=int, default=2000)
    parser.add_argument("--tables", type=int, default=CshOptions().tables)
    arguments = parser.parse_args()
    options = CshOptions(tables=arguments.tables)
    compare("", made_up(40, 40), seen_later(made_up(40, 40)), 10, options)  # compiles
    scenes = [
        (path.name, read_photo(path, transfer="linear", whole_frame=True).image)
        for path in arguments.photos
    ] or [("made up", made_up(700, 714))]
    print(
        "pair                        Mpx  exhaustive s  hashing s  times faster  distance  squared  best found"
    )
    for name, image in scenes:
        scene = resized(image.astype(np.float64), arguments.megapixels)
        middle = scene.shape[1] // 2
        for kind, first, second in (
            ("later view", scene, seen_later(scene)),
            ("halves", scene[:, :middle], scene[:, middle:]),
        ):
            row = compare(f"{name}, {kind}", first, second, arguments.sample, options)
            print(
                f"{row.name:26s} {row.megapixels:5.2f} {row.exhaustive:12.0f} {row.hashing:11.2f} {row.exhaustive / row.hashing:13.0f}"
                f" {row.distance:9.4f} {row.squared:8.4f} {row.best:10.1%}",
                flush=True,
            )


if __name__ == "__main__":
    main()
