"""What a result owes to the photo's size and its last digits, and what full detail costs.

  python -m benchmarks.detail.stability shape|scale|digits [--photos DIR] [--set NAME=VALUE]...
  python -m benchmarks.detail.stability objects [--shared DIR]
  python -m benchmarks.detail.stability cost [--megapixels .1,.5,2,8] [--set NAME=VALUE]...

`shape`: median angle between the normals of --max-size 1024 and 256, both smoothed to an object of
256 pixels. `scale`: normals at --max-size 192, 256 and 384 against those at 512. Photos whose
object is shorter are enlarged first. `digits`: median change of the normals when every value of a
photo changes by 1e-7 of itself, and `objects`: change of the average error on the ten MIT-Berkeley
objects, as users run them. `cost`: the whole pipeline with --max-size 0 on a ball with relief and
print, each size in a process of its own.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import list_objects
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.errors import InputError
from isc_core.evaluation.metrics import score
from isc_core.evaluation.runner import Protocol, RunnerOptions, make_runner
from isc_core.photo import Photo, PhotoSource, read_photo
from isc_core.progress import Monitor
from isc_core.sirfs.priors.prior_file import shipped_prior_set

from ..sirfs.mit_berkeley import LIGHTS, rounded, rounded_image, training_object
from ..sirfs.scale import angle, magnified, scale_figures
from .measure import at_size, base_angle
from .settings import settings_of

LARGE, SMALL = 1024, 256  # pixels
_FIRST = 0.02  # megapixels: a first run compiles and loads


def shape_change(photo: Photo, settings: Settings) -> float:
    """Compare the overall shape of a large photo with that of a small one.

    Parameters
    ----------
    photo : Photo
    settings : Settings

    Returns
    -------
    float
        Median angle, degrees.
    """
    large, small = (
        decompose(magnified(photo, LARGE), replace(settings, max_size=size))
        for size in (LARGE, SMALL)
    )
    enlarged = at_size(small.normal, small.mask, large.mask.shape)
    both = large.mask & (enlarged[..., 2] != 0)
    return base_angle(enlarged, large.normal, both)


def digit_change(photo: Photo, settings: Settings) -> float:
    """Change the last digits of a photo.

    Parameters
    ----------
    photo : Photo
    settings : Settings

    Returns
    -------
    float
        Median change of the normals, degrees.
    """
    changed = rounded_image(photo.image, 1).astype(np.float32)
    first, second = (decompose(one, settings) for one in (photo, replace(photo, image=changed)))
    return angle(first.normal, second.normal, first.mask)


def object_changes(shared: Path) -> list[tuple[str, str, float, float]]:
    """Change the last digits of the ten objects.

    Parameters
    ----------
    shared : Path
        Folder with data/.

    Returns
    -------
    list of tuple
        Light, object, average error, and that of the changed photo over it.
    """
    options = RunnerOptions("joint", threads=1, protocol=Protocol.USERS)
    run, rows = make_runner(options, shipped_prior_set()), []
    for light in LIGHTS:
        for name in list_objects(shared / "data" / "mit_berkeley_train", light):
            truth = training_object(shared, name, light)
            errors = []
            for number in (0, 1):
                found = run(rounded(truth, number), Monitor())
                parts = {
                    part: getattr(found, part)
                    for part in ("height", "normal", "shading", "reflectance", "light")
                }
                errors.append(score(truth, **parts).average)
            rows.append((light, name, errors[0], errors[1] / errors[0]))
            print(f"{light:10s} {name:10s} {errors[0]:.4f} x{rows[-1][3]:.5f}", flush=True)
    return rows


def ball(megapixels: float) -> Photo:
    """Make a photo of a ball with relief on one half and print on the other.

    Parameters
    ----------
    megapixels : float
        Area of the ball, in millions of pixels.

    Returns
    -------
    Photo
    """
    radius = int(np.sqrt(megapixels * 1e6 / np.pi))
    i, j = np.mgrid[-radius - 2 : radius + 3, -radius - 2 : radius + 3].astype(np.float32)
    mask = i**2 + j**2 < radius**2
    normal = np.stack([j, -i, np.sqrt(np.maximum(radius**2 - i**2 - j**2, 1))], axis=-1) / radius
    wave = 0.1 * (j < 0)
    normal[..., 0] += wave * np.sin(j * (2 * np.pi / 12))
    normal[..., 1] += wave * np.sin(i * (2 * np.pi / 9))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    albedo = np.where((i // 20 + j // 20) % 2 * (j > 0) > 0, 0.3, 0.6)[..., None] * (1, 0.8, 0.6)
    light = 0.2 + 0.8 * np.clip(normal @ np.array([-0.4, 0.3, 0.85]), 0, None)
    codes = np.random.default_rng(0).normal(albedo * light[..., None], 0.003)
    image = np.where(mask[..., None], np.clip(codes, 0, 1), 0).astype(np.float32)
    source = PhotoSource("", mask.shape[::-1], 8, "srgb", "file")
    return Photo(image, mask, 1 / 3300, np.zeros_like(mask), source)


def cost_of(megapixels: float, settings: Settings) -> dict[str, float]:
    """Measure time and memory of one photo; call it in a process of its own.

    Parameters
    ----------
    megapixels : float
    settings : Settings

    Returns
    -------
    dict of str to float
        Valid pixels; seconds, and those of the processor; peak memory in bytes, and that before
        the run, with the photo made.
    """
    decompose(ball(_FIRST), settings)
    photo = ball(megapixels)
    before = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start, busy = time.perf_counter(), time.process_time()
    decompose(photo, settings)
    seconds, busy = time.perf_counter() - start, time.process_time() - busy
    peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    pixels = int(photo.mask.sum())
    return {"pixels": pixels, "seconds": seconds, "busy": busy, "peak": peak, "before": before}


def _print_costs(megapixels: Sequence[float], assignments: Sequence[str]) -> None:
    for size in megapixels:
        command = [sys.executable, "-m", "benchmarks.detail.stability", "cost", "--one", str(size)]
        command += [part for one in assignments for part in ("--set", one)]
        answer = subprocess.run(command, check=True, stdout=subprocess.PIPE)
        found = json.loads(answer.stdout)
        print(
            f"{found['pixels'] / 1e6:6.2f} megapixels: {found['seconds']:7.1f} s, of the processor "
            f"{found['busy']:.1f} s, {1e6 * found['busy'] / found['pixels']:.1f} s per megapixel; "
            f"peak {found['peak'] / 1e6:.0f} MB, before it {found['before'] / 1e6:.0f} MB",
            flush=True,
        )


def _print_changes(title: str, photos: Path, change: Callable[[Photo], float]) -> None:
    found = []
    for path in sorted(photos.glob("*.png")):
        found.append(change(read_photo(path)))
        print(f"{path.stem:12s} {found[-1]:.3f}", flush=True)
    print(f"{title}: median {np.median(found):.3f} degrees, worst {max(found):.3f}")


def _run(given: argparse.Namespace) -> None:
    settings = settings_of(given.set, Settings(threads=1))
    if given.what == "shape":
        _print_changes("shape", given.photos, lambda photo: shape_change(photo, settings))
    elif given.what == "digits":
        _print_changes("digits", given.photos, lambda photo: digit_change(photo, settings))
    elif given.what == "scale":
        for path in sorted(given.photos.glob("*.png")):
            figures = scale_figures(magnified(read_photo(path), 512))
            cells = "  ".join(f"{size}: {degrees:.2f}" for size, degrees, _ in figures)
            print(f"{path.stem:12s} {cells} degrees", flush=True)
    elif given.what == "objects":
        rows = object_changes(given.shared)
        ratios = np.abs(np.log([row[3] for row in rows]))
        print(f"objects: avg changes by {ratios.mean():.3%} on average, {ratios.max():.3%} at most")
    elif given.one is not None:
        print(json.dumps(cost_of(given.one, replace(settings, max_size=0))))
    else:
        _print_costs([float(one) for one in given.megapixels.split(",")], given.set)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add, shared = parser.add_argument, Path("../shared")
    add("what", choices=("shape", "scale", "digits", "objects", "cost"))
    add("--photos", type=Path, default=shared / "data" / "photos", help="photos with masks")
    add("--shared", type=Path, default=shared, help="folder with data/")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="a setting")
    add("--megapixels", default=".1,.5,2,8", help="default: %(default)s")
    add("--one", type=float, help=argparse.SUPPRESS)
    try:
        _run(parser.parse_args())
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
