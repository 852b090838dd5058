"""Fit the constants of the expected errors, and measure whether errors are as large as expected.

  python -m benchmarks.decomposition.expected_error WORLD --panoramas DIR [--fit N] [--test N]
  [--data ROOT] [--seed K] [--json FILE]

WORLD is a folder of `isc world build`. Bodies and panoramas that no network has learned from are
lit and photographed, each body from one side (`benchmarks.sirfs.prediction_weights`), and solved as
a user's photo is. The constants are fitted to the first N photos. They are tested on the others and
on the objects of a set like MIT-Berkeley's, ROOT, in laboratory light as photographed. The table
has five groups of equally many pixels, from the smallest expected error to the largest, with the
mean expected and the mean real error of each, and the area under the sparsification curve, mean
over photos: sorted by the expected error, by the error itself, and without information.

Limits: the other photos show other sides of some of the same bodies.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.decomposition.expected_error import Calibration, Evidence
from isc_core.decomposition.models import DecompositionTask, Settings, solve
from isc_core.decomposition.pipeline import assemble
from isc_core.errors import InputError
from isc_core.evaluation.image_metrics import sparsification
from isc_core.networks.scene_network import predict_scene
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.decomposition import Provenance
from isc_core.shading.spherical_harmonics import normal_from_reference
from isc_core.shading.surface_stencils import normals

from ..sirfs.prediction_weights import lit_bodies

_PIXELS = 1500  # of a photo, for the fit: every photo weighs the same
_GROUPS = 5
_CLIPPED = 254.5 / 255
_ROUNDS = 30  # of weighted least squares


@dataclass(frozen=True, eq=False)
class Truth:
    """A photo and what is true of it.

    Attributes
    ----------
    image : (H, W, 3) ndarray
        Linear light.
    mask : (H, W) bool ndarray
    code_value : float
        Of the photo's codes.
    normal, log_reflectance : (H, W, 3) ndarray
    """

    image: np.ndarray
    mask: np.ndarray
    code_value: float
    normal: np.ndarray
    log_reflectance: np.ndarray


@dataclass(frozen=True, eq=False)
class Solved:
    """Evidence and errors of one photo's N pixels.

    Attributes
    ----------
    evidence : Evidence
    normal : (N,) ndarray
        Angle to the true normal, degrees.
    reflectance : (N,) ndarray
        Mean over channels of the error of log reflectance, one factor aside.
    """

    evidence: Evidence
    normal: np.ndarray
    reflectance: np.ndarray


def lit(world: Path, panoramas: Path, count: int, seed: int) -> list[Truth]:
    """Photograph held-out bodies.

    Parameters
    ----------
    world, panoramas : Path
    count, seed : int

    Returns
    -------
    list of Truth
    """
    return [
        Truth(
            one.photo,
            one.mask,
            1 / 255,
            one.normal,
            np.log(np.maximum(one.diffuse, 1e-4)) - one.log_shading,
        )
        for one in lit_bodies(world, panoramas, count, seed)
    ]


def laboratory(root: Path) -> Iterator[Truth]:
    """Read the objects of a set like MIT-Berkeley's, in laboratory light as photographed.

    Parameters
    ----------
    root : Path

    Yields
    ------
    Truth
        Where shape and photo are known.
    """
    for name in list_objects(root, "laboratory"):
        found = load_object(root, name, "laboratory", "original")
        known = np.isfinite(found.height)
        yield Truth(
            found.image,
            found.valid & found.mask & known,
            1 / 65535,
            normal_from_reference(normals(np.where(known, found.height, 0))),
            np.log(np.maximum(found.reflectance, 1e-4)),
        )


def solved(truth: Truth) -> Solved:
    """Decompose a photo with the settings of a user, and compare with the truth.

    Parameters
    ----------
    truth : Truth

    Returns
    -------
    Solved
    """
    mask, size = truth.mask, (truth.mask.shape[1], truth.mask.shape[0])
    image = np.where(mask[..., None], truth.image, 0).astype(np.float32)
    clipped = mask & (image.max(axis=-1) >= _CLIPPED)
    source = PhotoSource("", size, 8, "linear", "")
    photo = Photo(image, mask, truth.code_value, clipped, source)
    task = DecompositionTask(photo, photo, Settings(threads=1))
    found = assemble(photo, solve(task), Provenance())
    evidence = Evidence.of(predict_scene(image, mask), found.normal, found.shading, mask)
    cosine = np.einsum("nc,nc->n", found.normal[mask], truth.normal[mask])
    off = np.log(np.maximum(found.reflectance[mask], 1e-4)) - truth.log_reflectance[mask]
    return Solved(
        evidence,
        np.degrees(np.arccos(np.clip(cosine, -1, 1))),
        np.abs(off - np.median(off)).mean(axis=1),
    )


def fitted(photos: Sequence[Solved]) -> Calibration:
    """Fit the constants by least squares of the errors, each photo with as many pixels.

    Parameters
    ----------
    photos : sequence of Solved

    Returns
    -------
    Calibration
    """
    rng = np.random.default_rng(0)
    chosen = [rng.choice(len(one.normal), _PIXELS) for one in photos]

    def column(name: str) -> np.ndarray:
        return np.concatenate(
            [getattr(one.evidence, name)[k] for one, k in zip(photos, chosen, strict=True)]
        )

    normal, reflectance = (
        np.concatenate([getattr(one, name)[k] for one, k in zip(photos, chosen, strict=True)])
        for name in ("normal", "reflectance")
    )
    floor = np.ones(len(normal))
    shape = _factors([floor, column("spread"), column("distance")], normal)
    paint = _factors([column("deviation"), column("shading_distance")], reflectance)
    return Calibration(*(round(float(value), 3) for value in (*shape, *paint)))


def _factors(columns: Sequence[np.ndarray], error: np.ndarray) -> np.ndarray:
    """Factors f >= 0 that minimise sum (sqrt(sum_k f_k^2 column_k^2) - error)^2.

    Newton's method on the squares of the factors (Gauss, Newton): the root is linear around the
    present expectation e, sqrt(s) ~ (s / e + e) / 2.
    """
    squares = np.square(np.stack(columns, axis=1))
    weight = nnls(squares, np.square(error))[0]
    for _ in range(_ROUNDS):
        expected = np.sqrt(np.maximum(squares @ weight, 1e-9))
        weight = nnls(squares / (2 * expected[:, None]), error - expected / 2)[0]
    return np.asarray(np.sqrt(weight))


def table(name: str, photos: Sequence[Solved], constants: Calibration) -> list[str]:
    """Compare expected with real errors.

    Parameters
    ----------
    name : str
        Of the photos.
    photos : sequence of Solved
    constants : Calibration

    Returns
    -------
    list of str
        Rows of a Markdown table.
    """
    rows = []
    for kind, quantity in enumerate(("normal", "reflectance")):
        expected = [one.evidence.errors(constants)[kind] for one in photos]
        real = [getattr(one, quantity) for one in photos]
        all_expected, all_real = np.concatenate(expected), np.concatenate(real)
        groups = np.array_split(np.argsort(all_expected, kind="stable"), _GROUPS)
        cells = [f"{all_expected[g].mean():.3g} / {all_real[g].mean():.3g}" for g in groups]
        area = np.mean([sparsification(r, -e).area for e, r in zip(expected, real, strict=True)])
        best = np.mean([sparsification(r, -r).area for r in real])
        whole = f"{all_expected.mean():.3g} / {all_real.mean():.3g}"
        rows.append(
            f"| {name}, {quantity} | {len(photos)} | "
            + " | ".join([*cells, whole])
            + f" | {area:.3f} | {best:.3f} |"
        )
    return rows


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--fit", type=int, default=60, help="photos to fit to (default: %(default)s)")
    add("--test", type=int, default=36, help="photos to test them on (default: %(default)s)")
    add("--data", type=Path, metavar="ROOT", help="a set like MIT-Berkeley's, to test them on, too")
    add("--seed", type=int, default=1, help="of the photos")
    add("--json", type=Path, help="file for the constants")
    given = parser.parse_args()
    try:
        photos = lit(given.world, given.panoramas, given.fit + given.test, given.seed)
        found = [solved(truth) for truth in photos]
        measured = [] if given.data is None else [solved(one) for one in laboratory(given.data)]
    except InputError as error:
        parser.error(str(error))
    constants = fitted(found[: given.fit])
    if given.json:
        given.json.write_text(json.dumps(asdict(constants), indent=2) + "\n", encoding="utf-8")
    sys.stdout.write(report(found[: given.fit], found[given.fit :], measured, constants))


def report(
    learned: Sequence[Solved],
    tested: Sequence[Solved],
    measured: Sequence[Solved],
    constants: Calibration,
) -> str:
    """Format constants and errors.

    Parameters
    ----------
    learned, tested, measured : sequence of Solved
        Photos of the fit, others, and measured objects; those that are empty are left out.
    constants : Calibration

    Returns
    -------
    str
        Markdown.
    """
    numbers = ", ".join(f"group {k + 1}" for k in range(_GROUPS)).split(", ")
    lines = [
        str(constants),
        "",
        "| photos | number | " + " | ".join(numbers) + " | all | area | least area |",
        "|---|---" + "|---" * (_GROUPS + 3) + "|",
    ]
    for name, photos in (("fitted", learned), ("others", tested), ("measured", measured)):
        if photos:
            lines += table(name, photos, constants)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
