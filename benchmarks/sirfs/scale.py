"""Measure how the result depends on the photo's scale and padding, and what a larger photo costs.

  python -m benchmarks.sirfs.scale [--photos DIR] [--resized] [--cost]

For each photo (enlarged if its object is shorter than 512 pixels): normals at --max-size 192, 256
and 384 against those at 512, compared on the smaller grid, and the ratio of relative heights;
normals with 16 and 64 pixels of padding against none. `--resized`: photos of these sizes, instead
of one photo with maps of these sizes, whose overall shape is the same. `--cost`: time and peak
memory of the solve at full scale, from 0.1 to 4 megapixels of valid pixels.
"""

import argparse
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.program import run_program
from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.imaging.bounding_box import mask_box
from isc_core.imaging.resampling import resample_inside
from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.photo import Photo, read_photo
from isc_core.scene.decomposition import Decomposition
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.recover import RecoverOptions, recover
from isc_core.sirfs.settings import isc_weights
from isc_core.sirfs.solver import SolverOptions

SIZES = (192, 256, 384, 512)


def angle(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> float:
    """Return the median angle between two normal maps inside the mask.

    Parameters
    ----------
    a, b : (H, W, 3) ndarray
        Unit normals in the same frame.
    mask : (H, W) ndarray of bool
        Pixels that count.

    Returns
    -------
    float
        In degrees.
    """
    return float(np.degrees(np.median(np.arccos(np.clip((a * b).sum(-1)[mask], -1, 1)))))


def magnified(photo: Photo, least: int) -> Photo:
    """Enlarge the photo if its object is too small.

    Parameters
    ----------
    photo : Photo
    least : int
        Least length of the longer side of the object's bounding box, in pixels.

    Returns
    -------
    Photo
        The same photo if its object is large enough.
    """
    long = max(photo.box[2:])
    if long >= least:
        return photo
    factor = least / long + 1e-9
    image, _ = resample_inside(photo.image, np.ones_like(photo.mask), factor)
    mask = resample_inside(photo.mask.astype(float), np.ones_like(photo.mask), factor)[0] >= 0.5
    return replace(
        photo, image=image.astype(np.float32), mask=mask, clipped=np.zeros_like(mask), scale=1.0
    )


def padded(photo: Photo, by: int) -> Photo:
    """Add black space around the photo.

    Parameters
    ----------
    photo : Photo
    by : int
        Pixels to add on every side.

    Returns
    -------
    Photo
    """
    sides = [(by, by), (by, by)]
    return replace(
        photo,
        image=np.pad(photo.image, [*sides, (0, 0)]),
        mask=np.pad(photo.mask, sides),
        clipped=np.pad(photo.clipped, sides),
    )


def scale_figures(photo: Photo, *, resized: bool = False) -> list[tuple[int, float, float]]:
    """Compare sizes with 512 pixels.

    Parameters
    ----------
    photo : Photo
        The photo.
    resized : bool, optional
        Whether the photo is resized, and not the maps alone.

    Returns
    -------
    list of tuple
        Size, median change of the normals in degrees, ratio of the relative height ranges.
    """
    photos = {size: photo.resized_to_object(size) if resized else photo for size in SIZES}
    results = {size: decompose(one, Settings(max_size=size)) for size, one in photos.items()}
    largest = results[SIZES[-1]]
    figures = []
    for size in SIZES[:-1]:
        small = results[size]
        spread = [
            float(np.std(d.height[d.mask])) / max(mask_box(d.mask)[2:]) for d in (small, largest)
        ]
        figures.append((size, change_of_normals(small, largest), spread[0] / spread[1]))
    return figures


def change_of_normals(small: Decomposition, large: Decomposition) -> float:
    """Compare the normals of a small result with those of a large one, on the smaller grid.

    Parameters
    ----------
    small, large : Decomposition
        Of the same photo.

    Returns
    -------
    float
        Median angle, degrees.
    """
    factor = small.mask.shape[0] / large.mask.shape[0]
    normal, share = resample_inside(large.normal.astype(float), large.mask, factor)
    rows, columns = (min(a, b) for a, b in zip(normal.shape[:2], small.mask.shape, strict=True))
    normal, share = normal[:rows, :columns], share[:rows, :columns]
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    both = small.mask[:rows, :columns] & (share > 0.99)
    return angle(normal, small.normal[:rows, :columns].astype(float), both)


def padding_figures(photo: Photo) -> list[tuple[int, float]]:
    """Measure how padding changes the normals.

    Parameters
    ----------
    photo : Photo

    Returns
    -------
    list of (int, float)
        For each padding in pixels, the median change of the normals in degrees.
    """
    plain = decompose(photo)
    figures = []
    for by in (16, 64):
        normal = decompose(padded(photo, by)).normal[by:-by, by:-by]
        figures.append((by, angle(normal, plain.normal, plain.mask)))
    return figures


def cost_of(megapixels: float) -> None:
    """Solve a synthetic ball at full scale and print seconds and peak memory.

    Parameters
    ----------
    megapixels : float
        Area of the ball in millions of pixels.
    """
    radius = int(np.sqrt(megapixels * 1e6 / np.pi))
    i, j = np.mgrid[-radius - 2 : radius + 3, -radius - 2 : radius + 3] / radius
    mask = i**2 + j**2 < 1
    n3 = np.sqrt(np.maximum(1 - i**2 - j**2, 0))
    albedo = np.where(((5 * i).astype(int) + (5 * j).astype(int)) % 2 == 0, 0.6, 0.3)
    image = np.stack(
        [
            albedo * c * (0.2 + 0.8 * np.maximum(0.3 * -i - 0.4 * j + 0.85 * n3, 0))
            for c in (1, 0.8, 0.6)
        ],
        -1,
    )
    priors = shipped_prior_set().priors("natural", 3)
    options = RecoverOptions(
        solve_size=0, solver=SolverOptions(lbfgs=LbfgsOptions(iterations=30, loss_tolerance=0))
    )
    small = mask[:: max(1, radius // 60), :: max(1, radius // 60)]
    recover(
        image[:: max(1, radius // 60), :: max(1, radius // 60)],
        small,
        1e-5,
        priors,
        isc_weights("natural", 3),
        options,
    )  # compiles
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    result = recover(image, mask, 1e-5, priors, isc_weights("natural", 3), options)
    seconds, peak = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    pixels = int(mask.sum())
    print(
        f"{pixels / 1e6:6.2f} megapixels: {result.evaluations:4d} evaluations "
        f"of {1e3 * seconds / result.evaluations:8.2f} ms, {seconds:7.1f} s, "
        f"{1e9 * seconds / result.evaluations / pixels:5.1f} ns per pixel and evaluation; "
        f"peak {peak / 1024:.0f} MB, {(peak - before) * 1024 / pixels:.0f} bytes per pixel "
        "more than a small solve",
        flush=True,
    )


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--photos", type=Path, default=Path("../shared/data/photos"), help="photos with masks"
    )
    parser.add_argument("--resized", action="store_true", help="photos of these sizes")
    parser.add_argument("--cost", action="store_true", help="measure time and memory")
    parser.add_argument("--one", type=float, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        cost_of(given.one)
        return
    if given.cost:
        for megapixels in (0.1, 0.25, 1.0, 4.0):
            subprocess.run(
                [sys.executable, "-m", "benchmarks.sirfs.scale", "--one", str(megapixels)],
                check=True,
            )
        return
    for path in sorted(given.photos.glob("*.png")):
        photo = read_photo(path)
        figures = scale_figures(magnified(photo, 512), resized=given.resized)
        sizes = "  ".join(f"{s}: {a:.2f} deg, height x{r:.3f}" for s, a, r in figures)
        pads = "  ".join(f"+{by}: {a:.2f} deg" for by, a in padding_figures(photo))
        print(f"{path.stem:12s} {sizes}   padding {pads}", flush=True)


if __name__ == "__main__":
    run_program(main)
