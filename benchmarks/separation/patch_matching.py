"""Compare Coherency Sensitive Hashing with the exhaustive comparison of all pairs of patches.

  python -m benchmarks.separation.patch_matching [PHOTO ...] [--megapixels .5] [--sample 2000]
  [--tables 8]

For each photo, resized (without one, a procedural texture), two pairs of images are matched: the
photo and a rotated, enlarged, noisy copy ("later view"), and its two halves ("halves"). The
exhaustive search compares all source patches with a random sample of target patches by one matrix
product (BLAS, float32, all cores); its time for all target patches is extrapolated. The distances
of the matches are exact in both. Times are wall-clock times after compilation.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchmarks.program import run_program
from isc_core.inpainting.coherency_sensitive_hashing import (
    CshOptions,
    CshSearch,
    Patches,
    patches_within,
)
from isc_core.photo import WholeFrame, read_photo

# Source patches that the exhaustive search compares at once: the products then fit the cache.
_BLOCK = 4096


@dataclass(frozen=True)
class MatchingRow:
    """Result of one pair of images.

    Attributes
    ----------
    name : str
        Name of the pair.
    megapixels : float
        Size of the source.
    exhaustive, hashing : float
        Seconds of both searches.
    distance, squared : float
        Mean distance and mean squared distance of the matches over those of the best matches.
    best : float
        Share of sampled patches with a best match.
    """

    name: str
    megapixels: float
    exhaustive: float
    hashing: float
    distance: float
    squared: float
    best: float


def procedural_texture(height: int, width: int) -> np.ndarray:
    """Return a texture with shapes of all sizes and edges.

    Parameters
    ----------
    height, width : int
        In pixels.

    Returns
    -------
    (height, width, 3) ndarray
        Between 0 and 1.
    """
    rng = np.random.default_rng(1)
    image = np.zeros((height, width, 3))
    for sigma in (1.0, 3.0, 9.0, 27.0):
        noise = ndimage.gaussian_filter(
            rng.normal(size=image.shape), (sigma, sigma, 0), mode="wrap"
        )
        image += np.sign(noise) * np.abs(noise / noise.std()) ** 0.3
    return np.clip(0.5 + 0.1 * image, 0, 1)


def later_view(image: np.ndarray) -> np.ndarray:
    """Return the image rotated by 4 degrees, enlarged by 4 %, with 0.5 % noise.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Between 0 and 1.

    Returns
    -------
    (H, W, 3) ndarray
        Not clipped.
    """
    turn = (
        np.array([[np.cos(0.07), np.sin(0.07), 0], [-np.sin(0.07), np.cos(0.07), 0], [0, 0, 1.04]])
        / 1.04
    )
    moved = ndimage.affine_transform(
        image, turn, offset=(0.01 * len(image), 0.01 * len(image), 0), order=1, mode="reflect"
    )
    return moved + 0.005 * np.random.default_rng(9).normal(size=image.shape)


def resized(image: np.ndarray, megapixels: float) -> np.ndarray:
    """Resize an image to about the given number of megapixels.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    megapixels : float
        Size of the result in millions of pixels.

    Returns
    -------
    (H', W', 3) ndarray
        Not negative.
    """
    factor = float(np.sqrt(megapixels * 1e6 / (image.shape[0] * image.shape[1])))
    return np.clip(ndimage.zoom(image, (factor, factor, 1), order=3 if factor > 1 else 1), 0, None)


def vectors(patches: Patches, first: int, last: int, which: np.ndarray | None = None) -> np.ndarray:
    """Collect patches as rows.

    Parameters
    ----------
    patches : Patches
        All patches of an image.
    first, last : int
        Range of patches, if `which` is None.
    which : (n,) ndarray of int, optional
        Indices of patches.

    Returns
    -------
    (n, 64 C) ndarray
        Their values.
    """
    chosen = np.arange(first, min(last, len(patches))) if which is None else which
    rows, columns = patches.rows[chosen], patches.columns[chosen]
    return np.stack(
        [patches.image[rows + a, columns + b] for a in range(8) for b in range(8)], axis=1
    ).reshape(len(chosen), -1)


def exhaustive(source: Patches, target: Patches, sample: np.ndarray) -> tuple[np.ndarray, float]:
    """Search all source patches.

    Parameters
    ----------
    source, target : Patches
        Patches to search, and to search for.
    sample : (n,) ndarray of int
        Indices of target patches.

    Returns
    -------
    distance : (n,) ndarray
        Squared distances to the best source patches.
    seconds : float
        Time taken.
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
    # Exact distances of the winners: the differences above lose digits.
    return ((wanted.astype(np.float64) - vectors(source, 0, 0, where)) ** 2).sum(axis=1), seconds


def compare(
    name: str, first: np.ndarray, second: np.ndarray, sample: int, options: CshOptions
) -> MatchingRow:
    """Search for patches of `second` among those of `first` with both methods.

    Parameters
    ----------
    name : str
        Name of the pair.
    first, second : (H, W, 3) ndarray
        Linear images.
    sample : int
        Number of target patches of the exhaustive search.
    options : CshOptions
        Of the hashing.

    Returns
    -------
    MatchingRow
        Times and quality.
    """
    source, target = (
        patches_within(image, np.ones(image.shape[:2], bool)) for image in (first, second)
    )
    start = time.perf_counter()
    matches = CshSearch(source, options).match(target)
    hashing = time.perf_counter() - start
    which = np.random.default_rng(2).choice(len(target), min(sample, len(target)), replace=False)
    best, seconds = exhaustive(source, target, which)
    found = matches.distance[which].astype(np.float64)
    return MatchingRow(
        name,
        first.shape[0] * first.shape[1] / 1e6,
        seconds * len(target) / len(which),
        hashing,
        float(np.sqrt(found).mean() / np.sqrt(best).mean()),
        float(found.mean() / best.mean()),
        float((found <= best * 1.0001 + 1e-12).mean()),
    )


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photos", nargs="*", type=Path, help="photos to match")
    parser.add_argument("--megapixels", type=float, default=0.5, help="size after resizing")
    parser.add_argument("--sample", type=int, default=2000, help="patches of the exhaustive search")
    parser.add_argument("--tables", type=int, default=CshOptions().tables, help="hash tables")
    arguments = parser.parse_args()
    options = CshOptions(tables=arguments.tables)
    compare(
        "", procedural_texture(40, 40), later_view(procedural_texture(40, 40)), 10, options
    )  # compiles
    scenes = [
        (path.name, read_photo(path, transfer="linear", whole_frame=WholeFrame.WITHOUT_MASK).image)
        for path in arguments.photos
    ] or [("procedural", procedural_texture(700, 714))]
    print(
        "pair                        Mpx  exhaustive s  hashing s  times faster  distance  squared"
        "  best match"
    )
    for name, image in scenes:
        scene = resized(image.astype(np.float64), arguments.megapixels)
        middle = scene.shape[1] // 2
        for kind, first, second in (
            ("later view", scene, later_view(scene)),
            ("halves", scene[:, :middle], scene[:, middle:]),
        ):
            row = compare(f"{name}, {kind}", first, second, arguments.sample, options)
            print(
                f"{row.name:26s} {row.megapixels:5.2f} {row.exhaustive:12.0f} {row.hashing:11.2f}"
                f" {row.exhaustive / row.hashing:13.0f} {row.distance:9.4f}"
                f" {row.squared:8.4f} {row.best:10.1%}",
                flush=True,
            )


if __name__ == "__main__":
    run_program(main)
