"""How strongly should SIRFS expect white light? Measured on held-out bodies.

  python -m benchmarks.sirfs.light_colour WORLD --panoramas DIR [--count N] [--weights A,B,...]
  [--light KIND] [--seed K] [--cast F] [--json FILE]

WORLD is a folder of `isc world build`. Bodies and panoramas that no fit has seen are photographed
as for `prediction_weights`; the network sees the photo, SIRFS solves the true diffuse image as
users' photos are solved, with no expectation
of the light's colour ("free") and with it, by weight. `--cast .15` multiplies each photo's channels
by random factors of up to 15 %, as a wrong white balance does.

Errors: mean angle of the normals; mean error of log shading but for its brightness; reflectance,
as the mean angle between colours and as the least mean squared error of any scale over the mean
square. Tables give the geometric mean over photos relative to the first way, its 95 % interval over
bodies, and the plain median. The last column is the ratio of the strongest to the weakest channel
of the mean shading: its 90th percentile.

Limits: as for `prediction_weights`.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from isc_core.decomposition.models import DecompositionTask, Settings, SolveOptions, solve
from isc_core.errors import InputError
from isc_core.networks.scene_network import predict_scene
from isc_core.photo import Photo, PhotoSource
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    normal_from_reference,
    real_sh,
)
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.settings import BALANCED_LIGHT
from training.world.recipes import LightKind

from .prediction_weights import Lit, lit_bodies

FREE = "free"
METRICS = ("normals", "log shading", "colour angle", "reflectance")


@dataclass(frozen=True)
class Answer:
    """Errors of one solution.

    Attributes
    ----------
    errors : tuple of float
        In the order of `METRICS`.
    ratio, true_ratio : float
        Strongest over weakest channel of the mean shading on the object, found and true.
    """

    errors: tuple[float, ...]
    ratio: float
    true_ratio: float


def cast(photos: list[Lit], most: float, seed: int) -> list[Lit]:
    """Multiply the channels of each photo by random factors; light and photo change together.

    Parameters
    ----------
    photos : list of Lit
    most : float
        Largest change, such as .15.
    seed : int

    Returns
    -------
    list of Lit
    """
    rng = np.random.default_rng(seed)
    changed = []
    for lit in photos:
        factor = rng.uniform(1 - most, 1 + most, 3).astype(np.float32)
        changed.append(
            replace(
                lit,
                photo=lit.photo * factor,
                diffuse=lit.diffuse * factor,
                log_shading=lit.log_shading + np.log(factor),
            )
        )
    return changed


def answers_of(lit: Lit, ways: list[str]) -> list[Answer]:
    """Solve one photo in every way.

    Parameters
    ----------
    lit : Lit
    ways : list of str
        `FREE`, or a weight.

    Returns
    -------
    list of Answer
    """
    return [solved(lit, way) for way in ways]


def solved(lit: Lit, way: str) -> Answer:
    """Solve one photo in one way.

    Parameters
    ----------
    lit : Lit
    way : str

    Returns
    -------
    Answer
    """
    size, mask = (lit.mask.shape[1], lit.mask.shape[0]), lit.mask
    photo = Photo(
        np.where(mask[..., None], lit.diffuse, 0).astype(np.float32),
        mask,
        1 / 255,
        np.zeros_like(mask),
        PhotoSource("", size, 8, "linear", ""),
    )
    weight = BALANCED_LIGHT if way == FREE else replace(BALANCED_LIGHT, weight=float(way))
    settings = Settings("sirfs", threads=1, light_colour=FREE if way == FREE else "balanced")
    options = SolveOptions(
        solve_size=0, fit_lobe=False, check_assumptions=False, light_colour_weight=weight
    )
    seen = predict_scene(lit.photo, lit.mask)
    found = solve(DecompositionTask(photo, photo, settings, options=options, prediction=seen))
    normal = normal_from_reference(normals(found.height))
    log_shading = real_sh(normal) @ light_from_reference(found.light)
    return measured(lit, normal, log_shading)


def measured(lit: Lit, normal: np.ndarray, log_shading: np.ndarray) -> Answer:
    """Compute the errors of a solution.

    Parameters
    ----------
    lit : Lit
        The truth.
    normal, log_shading : (H, W, 3) ndarray

    Returns
    -------
    Answer
    """
    mask = lit.mask
    cosine = np.einsum("nc,nc->n", normal[mask], lit.normal[mask])
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())
    off = (log_shading - lit.log_shading)[mask]
    shading = float(np.abs(off - np.median(off)).mean())
    diffuse = np.maximum(lit.diffuse[mask], 1e-4)
    true, found = diffuse * np.exp(-lit.log_shading[mask]), diffuse * np.exp(-log_shading[mask])
    across = np.einsum("nc,nc->n", true, found) / np.sqrt(
        np.square(true).sum(1) * np.square(found).sum(1)
    )
    colour = float(np.degrees(np.arccos(np.clip(across, -1, 1))).mean())
    scale = (true * found).sum() / np.square(found).sum()
    reflectance = float(np.square(scale * found - true).sum() / np.square(true).sum())
    return Answer(
        (angle, shading, colour, reflectance),
        _ratio(log_shading[mask]),
        _ratio(lit.log_shading[mask]),
    )


def _ratio(log_shading: np.ndarray) -> float:
    mean = np.exp(log_shading).mean(axis=0)
    return float(mean.max() / mean.min())


def report(ways: list[str], found: list[list[Answer]]) -> str:
    """Format the errors relative to the first way.

    Parameters
    ----------
    ways : list of str
    found : list of list of Answer
        Of each photo, in each way.

    Returns
    -------
    str
        A Markdown table.
    """
    errors = np.array([[one.errors for one in photo] for photo in found])
    ratios = np.array([[one.ratio for one in photo] for photo in found])
    relative = np.log(errors / errors[:, :1])
    rng = np.random.default_rng(0)
    again = rng.integers(len(relative), size=(2000, len(relative)))
    low, high = np.exp(np.quantile(relative[again].mean(axis=1), (0.025, 0.975), axis=0))
    middle, plain = np.exp(relative.mean(axis=0)), np.median(errors, axis=0)
    lines = [
        "| weight | " + " | ".join(METRICS) + " | channels, 90 % |",
        "|---" * (len(METRICS) + 2) + "|",
    ]
    for k, way in enumerate(ways):
        cells = [
            f"{middle[k, m]:.3f} ({low[k, m]:.2f}-{high[k, m]:.2f}; {plain[k, m]:.3g})"
            for m in range(len(METRICS))
        ]
        cells.append(f"{np.quantile(ratios[:, k], 0.9):.2f}")
        lines.append(f"| {way} | " + " | ".join(cells) + " |")
    true = np.quantile([photo[0].true_ratio for photo in found], (0.5, 0.9))
    return "\n".join([*lines, "", f"true channels: median {true[0]:.2f}, 90 % {true[1]:.2f}"])


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--count", type=int, default=24, help="photos (default: %(default)s)")
    add("--weights", default="free,.1,.3,1,3,10", help="default: %(default)s")
    add("--light", choices=[kind.name for kind in LightKind], help="kind of light (default: all)")
    add("--cast", type=float, default=0, help="error of white balance (default: %(default)s)")
    add("--seed", type=int, default=0, help="of the photos")
    add("--workers", type=int, default=2, help="processes")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    ways = given.weights.split(",")
    try:
        photos = lit_bodies(given.world, given.panoramas, given.count, given.seed, given.light)
    except InputError as error:
        parser.error(str(error))
    photos = cast(photos, given.cast, given.seed)
    with ProcessPoolExecutor(given.workers) as pool:
        found = list(pool.map(partial(answers_of, ways=ways), photos))
    if given.json:
        rows = [[one.errors for one in photo] for photo in found]
        given.json.write_text(json.dumps({"ways": ways, "errors": rows}), encoding="utf-8")
    print(report(ways, found))


if __name__ == "__main__":
    main()
