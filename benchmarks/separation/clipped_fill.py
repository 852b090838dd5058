"""Fills under clipped highlights of large objects: from the whole object, or from surroundings.

  python -m benchmarks.separation.clipped_fill WORLD --panoramas DIR [--part PART] [--count N]
  [--seed N] [--json FILE]

Problem: a search for patches in the whole object takes time in proportion to its pixels, also for a
hole of a few. Is a search near the hole as good?

Construction: photos of `print_set`, N glossy and N / 2 matt ones, with the diffuse light enlarged
4.5 times, to objects of 630 pixels, and noise of a camera added. Holes are the clipped highlights
of a glossy object; on every object, one to three ellipses as well, 5 to 120 pixels long. Shading is
predicted from the small photo. Error of a fill: mean squared error of the logarithm of diffuse
light in the hole. Intervals are of resampled bodies.

Limits: enlarged photos have no texture finer than the small ones. Nothing is under the holes but
the diffuse light: traces of a highlight around a hole are not part of it.
"""

import argparse
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from zlib import crc32

import numpy as np
from scipy import ndimage

from benchmarks.bootstrap import bootstrap_samples, interval
from isc_core.errors import InputError
from isc_core.networks.scene_network import predict_layers
from isc_core.separation.support.clipped_texture import inpaint_clipped

from .print_set import Part, PrintScene, print_scenes

_FINER = 4.5
_NOISE = 0.004  # of the white, in the dark; twice that at the white
_HIGHLIGHT = 0.1  # specular light, of the white, in a hole
_SPREAD = 2  # pixels around clipped ones that mix with them
_RADIUS, _RIM = (2.5, 60.0), 20  # of made holes; of their centres from the outline; pixels
_DARK = 1e-3  # of the brightest value: the least in logarithms
_LEAST = 1e-6  # an error that is as good as none
_WHOLE, _NEAR = 1 << 40, 0  # largest box that is searched as a whole, pixels


@dataclass(frozen=True)
class FillErrors:
    """Errors and processor seconds of both fills of a photo's holes.

    Attributes
    ----------
    body, kind : str
        Name of the body; "clipped" or "made".
    whole, near : float
        Mean squared errors.
    whole_seconds, near_seconds : float
    """

    body: str
    kind: str
    whole: float
    near: float
    whole_seconds: float
    near_seconds: float


def fill_errors(scene: PrintScene, glossy: bool) -> list[FillErrors]:
    """Fill holes of an enlarged photo in both ways.

    Parameters
    ----------
    scene : PrintScene
    glossy : bool
        With clipped highlights.

    Returns
    -------
    list of FillErrors
        One for each kind of hole that the photo has.
    """
    rng = np.random.default_rng(crc32((scene.name + scene.body).encode()))
    log_shading = predict_layers(scene.photo, scene.mask).log_shading
    nearest = ndimage.distance_transform_edt(
        ~scene.mask, return_distances=False, return_indices=True
    )
    around = tuple(nearest)
    mask = _enlarged(scene.mask[..., None], 1)[..., 0] > 0.5
    inside = mask[..., None]
    diffuse = np.where(inside, np.maximum(_enlarged(scene.diffuse[around], 3), 0), 0)
    noisy = diffuse + rng.normal(0, _NOISE, diffuse.shape) * (1 + diffuse)
    diffuse = np.where(inside, np.clip(noisy, 0, 1), 0).astype(np.float32)
    shading = _enlarged(log_shading[around], 1).astype(np.float32)
    holes = {"clipped": _clipped(scene, mask)} if glossy else {}
    holes["made"] = _made(mask, rng)
    errors = []
    for kind, hole in holes.items():
        if hole.any():
            both = [_tried(diffuse, hole, mask, shading, largest) for largest in (_WHOLE, _NEAR)]
            (whole, first), (near, second) = both
            errors.append(FillErrors(scene.body, kind, whole, near, first, second))
    return errors


def _enlarged(values: np.ndarray, order: int) -> np.ndarray:
    """Values (H, W, C), enlarged by splines."""
    planes = np.moveaxis(values.astype(float), -1, 0)
    return np.stack(
        [
            ndimage.zoom(plane, _FINER, order=order, mode="nearest", grid_mode=True)
            for plane in planes
        ],
        axis=-1,
    )


def _clipped(scene: PrintScene, mask: np.ndarray) -> np.ndarray:
    """Where clipped highlights hide the enlarged object."""
    holes = ndimage.binary_dilation(scene.clipped, iterations=_SPREAD) & scene.mask
    labels, count = ndimage.label(holes, np.ones((3, 3)))
    light = (scene.photo - scene.diffuse).mean(axis=2)
    most = np.zeros(count + 1)
    if count:
        most[1:] = ndimage.maximum(light, labels, np.arange(1, count + 1))
    bright = most > _HIGHLIGHT
    return np.asarray((_enlarged(bright[labels][..., None], 1)[..., 0] > 0.5) & mask)


def _made(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One to three ellipses on the object."""
    hole = np.zeros_like(mask)
    rows, columns = np.nonzero(ndimage.binary_erosion(mask, iterations=_RIM))
    y, x = np.mgrid[: mask.shape[0], : mask.shape[1]]
    for _ in range(int(rng.integers(1, 4)) if len(rows) else 0):
        k = int(rng.integers(len(rows)))
        radius = float(np.exp(rng.uniform(*np.log(_RADIUS))))
        share, angle = float(rng.uniform(0.4, 1)), float(rng.uniform(0, np.pi))
        right, down = x - columns[k], y - rows[k]
        along = right * np.cos(angle) + down * np.sin(angle)
        across = down * np.cos(angle) - right * np.sin(angle)
        hole |= (along / radius) ** 2 + (across / (share * radius)) ** 2 < 1
    return hole & mask


def _tried(
    diffuse: np.ndarray, hole: np.ndarray, mask: np.ndarray, shading: np.ndarray, largest: int
) -> tuple[float, float]:
    """The error of a fill, and its processor seconds."""
    image = np.where(hole[..., None], 1, diffuse).astype(np.float32)
    given = np.where(hole[..., None], 0, diffuse).astype(np.float32)
    start = time.process_time()
    found = inpaint_clipped(given, image, hole, mask, shading, largest)
    seconds = time.process_time() - start
    dark = _DARK * image[mask].max()
    error = np.log(np.maximum(found[hole], dark)) - np.log(np.maximum(diffuse[hole], dark))
    return float(np.square(error).mean()), seconds


def table(errors: list[FillErrors]) -> str:
    """Format the errors near the hole over those of the whole object.

    Parameters
    ----------
    errors : list of FillErrors

    Returns
    -------
    str
        A Markdown table.
    """
    lines = [
        "| holes | number | ratio of errors (95 %) | ratio of mean errors (95 %) | time |",
        "|---" * 5 + "|",
    ]
    for kind in ("clipped", "made", ""):
        rows = [one for one in errors if kind in ("", one.kind)]
        if not rows:
            continue
        whole, near = (np.array([getattr(one, name) for one in rows]) for name in ("whole", "near"))
        change = np.log((near + _LEAST) / (whole + _LEAST))
        bodies = np.unique([one.body for one in rows], return_inverse=True)[1]
        columns = (np.ones(len(rows)), change, near, whole)
        sums = np.stack([np.bincount(bodies, column) for column in columns], -1)
        number, changed, error, before = bootstrap_samples(sums).sum(axis=1).T
        first, second = np.exp(interval(changed / number)), interval(error / before)
        seconds = sum(one.near_seconds for one in rows) / sum(one.whole_seconds for one in rows)
        lines.append(
            f"| {kind or 'all'} | {len(rows)} "
            f"| {np.exp(change.mean()):.3f} ({first[0]:.3f}-{first[1]:.3f}) "
            f"| {near.mean() / whole.mean():.3f} ({second[0]:.3f}-{second[1]:.3f}) "
            f"| {seconds:.2f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, metavar="DIR", required=True, help="panoramas")
    add("--part", type=Part, default=Part.TEST, choices=list(Part), help="which bodies")
    add("--count", type=int, default=40, help="glossy photos (default: %(default)s)")
    add("--seed", type=int, default=0, help="of paint, light and sides (default: %(default)s)")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    errors = []
    try:
        for glossy, count in ((True, given.count), (False, given.count // 2)):
            for scene in print_scenes(
                given.world, given.panoramas, given.part, count, glossy, given.seed
            ):
                errors += fill_errors(scene, glossy)
    except InputError as error:
        parser.error(str(error))
    if given.json:
        given.json.write_text(json.dumps([asdict(one) for one in errors]), encoding="utf-8")
    print(table(errors))


if __name__ == "__main__":
    main()
