"""How far should SIRFS trust what the scene network predicts? Measured on held-out bodies.

  python -m benchmarks.sirfs.prediction_weights WORLD --panoramas DIR [--weights NPZ] [--count N]
  [--ways A,B,...] [--light KIND] [--illumination NAME] [--half 0|1] [--seed K] [--json FILE]

WORLD is a folder of `isc world build`. Bodies and panoramas that no fit has seen are lit and
photographed, each from one side; the network sees the photo, SIRFS its diffuse image. What is
chosen on bodies of one `--half` can be reported on the other: they share no body. Ways are those
of `ways`; "network" is the network's own answer. Errors are
geometric means over photos, relative to no prediction at all, with the 95 % interval of resampled
photos: mean angle of the normals, mean error of log shading but for its brightness (that of log
reflectance is the same), and but for its brightness in each channel.

Limits: shading has cast shadows, which SIRFS cannot explain.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from isc_core.decomposition.models import (
    DecompositionTask,
    SceneEstimate,
    Settings,
    SolveOptions,
    solve,
)
from isc_core.decomposition.settings import ILLUMINATIONS
from isc_core.errors import InputError
from isc_core.networks.scene_network import SceneNetwork, ScenePrediction, predict_scene
from isc_core.photo import Photo, PhotoSource
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    normal_from_reference,
    real_sh,
)
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.settings import PredictionWeights
from training.world.files import half_of
from training.world.recipes import LightKind

from .ways import Predictions, with_way

WAYS = "-:-:-,network,.5:-:-,-:.5:-,-:-:1,.2:.2:4,.5:.5:1,1:1:1,1:3:1"
_LEAST_PIXELS = 1500
METRICS = ("normals", "shading", "shading, colour aside")


@dataclass(frozen=True, eq=False)
class Lit:
    """A photo of a held-out body.

    Attributes
    ----------
    photo, diffuse : (H, W, 3) float32 ndarray
        Linear light.
    mask : (H, W) ndarray of bool
    normal, log_shading : (H, W, 3) ndarray
        The truth.
    """

    photo: np.ndarray
    diffuse: np.ndarray
    mask: np.ndarray
    normal: np.ndarray
    log_shading: np.ndarray


def lit_bodies(
    world: Path,
    panoramas: Path,
    count: int,
    seed: int,
    light: str | None = None,
    side: int | None = None,
    half: int | None = None,
) -> list[Lit]:
    """Light and photograph held-out opaque bodies, each from one side.

    Parameters
    ----------
    world : Path
    panoramas : Path
    count : int
        Photos.
    seed : int
    light : str, optional
        Kind of light; by default all kinds, as often as the network has seen them.
    side : int, optional
        Pixels of a photo's side; by default those of the network's frame.
    half : int, optional
        0 or 1: one half of the bodies; by default all.

    Returns
    -------
    list of Lit
    """
    import torch

    from training.networks.scene_batches import read_world
    from training.world.files import Split
    from training.world.recipes import Shares
    from training.world.samples import OUTPUT, PhotoRenderer, draw_batch
    from training.world.view_batches import ViewStore

    torch.manual_seed(seed)
    found = read_world([world], panoramas, (Split.UNSEEN_BODY,), 0)
    shares = Shares(kinds=(1, 0, 0))
    if light is not None:
        shares = replace(shares, lights=tuple(float(kind.name == light) for kind in LightKind))
    bodies = [one for one in found.views[Split.UNSEEN_BODY] if half in (None, half_of(one.name))]
    rng, made, store = np.random.default_rng(seed), dict[str, Lit](), ViewStore(bodies)
    for k in rng.permutation(len(bodies)):
        if len(made) == count:
            break
        if (name := bodies[k].name) in made:  # from another side
            continue
        draw = draw_batch(
            bodies, np.array([k]), 1, found.atlas, found.held_out_environments, rng, shares
        )
        sample = PhotoRenderer(found.bank, 1, side or OUTPUT)(draw, store)
        mask = (sample.mask[0, 0] * sample.known[0, 0]).numpy() > 0
        photo, ratio, normal, shading = (
            part[0].permute(1, 2, 0).numpy()
            for part in (sample.photo, sample.ratio, sample.normal, sample.log_shading)
        )
        if mask.sum() > _LEAST_PIXELS:
            made[name] = Lit(photo, photo * np.exp(-ratio), mask, normal, shading)
    return list(made.values())


def errors_of(
    lit: Lit, ways: list[str], illumination: str, network: SceneNetwork | None
) -> list[list[float]]:
    """Solve one photo in every way.

    Parameters
    ----------
    lit : Lit
    ways : list of str
    illumination : str
        Of the priors.
    network : SceneNetwork

    Returns
    -------
    list of list of float
        For each way the errors in the order of `METRICS`.
    """
    seen = predict_scene(lit.photo, lit.mask, network)
    return [
        measured(lit, seen.normals.normal, seen.shading.log_shading)
        if way == "network"
        else solved(lit, seen, way, illumination)
        for way in ways
    ]


def solved(lit: Lit, seen: ScenePrediction, way: str, illumination: str) -> list[float]:
    """Solve one photo in one way.

    Parameters
    ----------
    lit : Lit
    seen : ScenePrediction
    way : str
    illumination : str

    Returns
    -------
    list of float
        In the order of `METRICS`.
    """
    found = estimated(lit, seen, way, illumination)
    normal = normal_from_reference(normals(found.height))
    return measured(lit, normal, real_sh(normal) @ light_from_reference(found.light))


def estimated(
    lit: Lit,
    seen: ScenePrediction,
    way: str,
    illumination: str,
    usual: PredictionWeights | None = None,
    solve_size: int = 0,
) -> SceneEstimate:
    """Solve one photo in one way.

    Parameters
    ----------
    lit : Lit
    seen : ScenePrediction
    way : str
    illumination : str
    usual : PredictionWeights, optional
        All that the way leaves open.
    solve_size : int, optional
        See `SolveOptions`.

    Returns
    -------
    SceneEstimate
    """
    size = lit.mask.shape[1], lit.mask.shape[0]
    image = np.where(lit.mask[..., None], lit.diffuse, 0).astype(np.float32)
    photo = Photo(
        image, lit.mask, 1 / 255, np.zeros_like(lit.mask), PhotoSource("", size, 8, "linear", "")
    )
    settings = Settings(
        "sirfs",
        illumination=illumination,
        threads=1,
        light_prior="dataset",
        shape_prior="silhouette",
    )
    options = SolveOptions(solve_size=solve_size, fit_lobe=False, check_assumptions=False)
    task = DecompositionTask(photo, photo, settings, options=options)
    predictions = Predictions(seen.normals, seen.shading, seen.light)
    return solve(with_way(task, predictions, way, usual))


def measured(lit: Lit, normal: np.ndarray, log_shading: np.ndarray) -> list[float]:
    """Compute the errors of normals and log shading.

    Parameters
    ----------
    lit : Lit
        The truth.
    normal, log_shading : (H, W, 3) ndarray

    Returns
    -------
    list of float
        In the order of `METRICS`.
    """
    mask = lit.mask
    length = np.linalg.norm(normal[mask], axis=1).clip(1e-6)
    cosine = np.einsum("nc,nc->n", normal[mask], lit.normal[mask]) / length
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())
    off = (log_shading - lit.log_shading)[mask]
    colour = off - np.median(off)
    return [angle, float(np.abs(colour).mean()), float(np.abs(off - np.median(off, axis=0)).mean())]


def report(ways: list[str], errors: np.ndarray) -> str:
    """Format the errors relative to the first way.

    Parameters
    ----------
    ways : list of str
    errors : (photos, ways, metrics) ndarray

    Returns
    -------
    str
        A Markdown table.
    """
    ratio = np.log(errors / errors[:, :1])
    rng = np.random.default_rng(0)
    again = rng.integers(len(ratio), size=(2000, len(ratio)))
    low, high = np.exp(np.quantile(ratio[again].mean(axis=1), (0.025, 0.975), axis=0))
    middle, plain = np.exp(ratio.mean(axis=0)), errors.mean(axis=0)
    lines = ["| way | " + " | ".join(METRICS) + " |", "|---" * (len(METRICS) + 1) + "|"]
    for k, way in enumerate(ways):
        cells = [
            f"{middle[k, m]:.3f} ({low[k, m]:.2f}-{high[k, m]:.2f}; {plain[k, m]:.3g})"
            for m in range(len(METRICS))
        ]
        lines.append(f"| {way} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--weights", type=Path, metavar="NPZ", help="scene network (default: the shipped one)")
    add("--count", type=int, default=24, help="photos (default: %(default)s)")
    add("--ways", default=WAYS, help="default: %(default)s")
    add("--light", choices=[kind.name for kind in LightKind], help="kind of light (default: all)")
    add("--illumination", default="photo", choices=ILLUMINATIONS, help="priors to use")
    add("--half", type=int, choices=(0, 1), help="of the bodies (default: all)")
    add("--seed", type=int, default=0, help="of the photos")
    add("--workers", type=int, default=2, help="processes")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    ways = given.ways.split(",")
    try:
        network = None if given.weights is None else SceneNetwork.read(given.weights)
        photos = lit_bodies(
            given.world, given.panoramas, given.count, given.seed, given.light, half=given.half
        )
    except InputError as error:
        parser.error(str(error))
    run = partial(errors_of, ways=ways, illumination=given.illumination, network=network)
    with ProcessPoolExecutor(given.workers) as pool:
        found = list(pool.map(run, photos))
    if given.json:
        given.json.write_text(json.dumps({"ways": ways, "errors": found}), encoding="utf-8")
    print(report(ways, np.array(found)))


if __name__ == "__main__":
    main()
