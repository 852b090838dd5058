"""What do the priors of photos gain on white-balanced photos of coloured glossy objects?

  python -m benchmarks.decomposition.photo_illumination WORLD --panoramas DIR [--count N]
  [--ways A,B,...] [--balance HOW] [--seed K] [--json FILE]

WORLD is a folder of `isc world build`. Bodies and panoramas that no fit has seen are photographed:
glossy paint of saturated and many colours, light from all around, white-balanced. `--balance card`
divides by the colour that a white ball in the body's place shows, and multiplies each channel by
e^z, z ~ N(0, .12^2), the error of a good camera; `camera` balances as
`training.priors.panorama_photos` does, by algorithms that see the panorama. Each photo is
decomposed as `isc decompose` does it by default, once for each way:

  natural        the priors of MIT-Berkeley in natural light
  photo          the default
  FILE.npz       the same with the priors of a file
  NAME:COLOUR    with --light-colour COLOUR, such as photo:free

Errors: mean angle between colours of reflectance; mean squared error of reflectance at its best
scale over its mean square; mean angle of normals. The table has medians, and relative to the first
way, the ratio of medians with its 95 % interval over bodies and the geometric mean of ratios.

Limits: paint and bodies are those of the world that the priors of photos are fitted to, though
others of their kind; panoramas are of the same photographers.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.bootstrap import bootstrap_samples, interval
from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.errors import InputError
from isc_core.imaging.channels import saturation
from isc_core.photo import Photo, PhotoSource
from isc_core.scene.decomposition import Decomposition
from isc_core.sirfs.priors.prior_file import load_prior_set

if TYPE_CHECKING:
    from training.world.environments import Panorama
    from training.world.samples import Sample

METRICS = ("colour angle", "reflectance", "normals")
_SIDE = 160  # pixels of the photos
_LEAST_PIXELS = 3000
_COLOURED = 0.35  # least saturation of the true reflectance
_WHITE = 0.995
_BALANCE_ERROR = 0.12  # deviation of each channel's log
BALANCES = ("card", "camera")


@dataclass(frozen=True, eq=False)
class Scene:
    """A photo of a held-out body, and its truth.

    Attributes
    ----------
    photo : (H, W, 3) float32 ndarray
        Linear.
    mask : (H, W) ndarray of bool
    normal, reflectance : (H, W, 3) ndarray
    cast : float
        Strongest over weakest channel of the balanced light.
    """

    photo: np.ndarray
    mask: np.ndarray
    normal: np.ndarray
    reflectance: np.ndarray
    cast: float


def balanced_scenes(
    world: Path, panoramas: Path, count: int, seed: int, balance: str = BALANCES[0]
) -> list[Scene]:
    """Photograph held-out bodies of coloured glossy paint in balanced light of held-out panoramas.

    Parameters
    ----------
    world : Path
    panoramas : Path
    count : int
    seed : int
    balance : str
        One of `BALANCES`.

    Returns
    -------
    list of Scene

    Raises
    ------
    InputError
        If WORLD or the panoramas cannot be read.
    """
    import torch

    from training.networks.scene_batches import read_world
    from training.priors.panorama_photos import read_pictures
    from training.world.files import Split
    from training.world.recipes import LightKind, Paint, Shares
    from training.world.samples import PhotoRenderer, draw_batch
    from training.world.view_batches import ViewStore

    torch.manual_seed(seed)
    found = read_world([world], panoramas, (Split.UNSEEN_BODY,), 0)
    pictures = read_pictures(panoramas)
    paints = {Paint.ONE: 0.2, Paint.FEW: 0.4, Paint.STRONG_WITH_WHITE: 0.3, Paint.NATURAL: 0.1}
    shares = Shares(
        kinds=(1, 0, 0),
        paints=tuple(paints.get(paint, 0.0) for paint in Paint),
        lights=tuple(float(kind == LightKind.AROUND) for kind in LightKind),
        matte=0,
    )
    rng, made, bodies = np.random.default_rng(seed), list[Scene](), found.views[Split.UNSEEN_BODY]
    store = ViewStore(bodies)

    def balanced(view: int) -> "Sample":
        draw = draw_batch(
            bodies, np.array([view]), 1, found.atlas, found.held_out_environments, rng, shares
        )
        turn = draw.recipes["turn"][0].double().numpy()
        colour = _balance(*pictures[int(draw.recipes["environment"][0])], turn, balance, rng)
        ambient = torch.from_numpy(1 / colour[None]).float()
        return PhotoRenderer(found.bank, 1, _SIDE)(
            replace(draw, recipes={**draw.recipes, "ambient": ambient}), store
        )

    for view in rng.permutation(len(bodies)):
        scene = _scene(balanced(int(view)))
        if scene is not None:
            made.append(scene)
        if len(made) == count:
            break
    return made


def _balance(
    panorama: "Panorama", radiance: np.ndarray, turn: np.ndarray, how: str, rng: np.random.Generator
) -> np.ndarray:
    """What the photo's light is divided by."""
    from training.priors.panorama_photos import camera_balance, camera_picture, colour_on_a_ball

    if how == "camera":
        return camera_balance(camera_picture(radiance, turn, rng)[0], rng)
    return colour_on_a_ball(panorama.radiance, turn) * np.exp(rng.normal(0, _BALANCE_ERROR, 3))


def _scene(sample: "Sample") -> Scene | None:
    """The scene of a sample; None if it is small or of little colour."""
    mask = (sample.mask[0, 0] * sample.known[0, 0]).numpy() > 0
    photo, ratio, normal, shading = (
        part[0].permute(1, 2, 0).numpy()
        for part in (sample.photo, sample.ratio, sample.normal, sample.log_shading)
    )
    if mask.sum() < _LEAST_PIXELS:
        return None
    reflectance = np.where(mask[..., None], photo * np.exp(-ratio - shading), 0)
    if saturation(reflectance[mask]) < _COLOURED:
        return None
    mean = np.exp(shading[mask]).mean(axis=0)
    return Scene(photo, mask, normal, reflectance, float(mean.max() / mean.min()))


def errors_of(scene: Scene, ways: list[str]) -> list[list[float]]:
    """Decompose one photo in every way.

    Parameters
    ----------
    scene : Scene
    ways : list of str

    Returns
    -------
    list of list of float
        For each way the errors in the order of `METRICS`.
    """
    mask = scene.mask
    photo = Photo(
        np.where(mask[..., None], scene.photo, 0).astype(np.float32),
        mask,
        1 / 255 / 12.92,
        mask & (scene.photo.max(axis=-1) > _WHITE),
        PhotoSource("", (mask.shape[1], mask.shape[0]), 8, "srgb", ""),
    )
    errors = []
    for way in ways:
        name, _, colour = way.partition(":")
        kind = "photo" if name.endswith(".npz") else name
        settings = Settings(illumination=kind, threads=1, light_colour=colour or "balanced")
        priors = load_prior_set(name) if name.endswith(".npz") else None
        errors.append(measured(scene, decompose(photo, settings, prior_set=priors)))
    return errors


def measured(scene: Scene, found: Decomposition) -> list[float]:
    """Compute the errors of a decomposition.

    Parameters
    ----------
    scene : Scene
        The truth.
    found : Decomposition

    Returns
    -------
    list of float
        In the order of `METRICS`.
    """
    mask = scene.mask
    true, answer = (
        np.maximum(map_[mask].astype(float), 1e-4)
        for map_ in (scene.reflectance, found.reflectance)
    )
    across = np.einsum("nc,nc->n", true, answer) / np.sqrt(
        np.square(true).sum(axis=1) * np.square(answer).sum(axis=1)
    )
    angle = np.degrees(np.arccos(np.clip(across, -1, 1))).mean()
    scale = (true * answer).sum() / np.square(answer).sum()
    squared = np.square(scale * answer - true).sum() / np.square(true).sum()
    cosine = np.einsum("nc,nc->n", scene.normal[mask], found.normal[mask].astype(float))
    normals = np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean()
    return [float(angle), float(squared), float(normals)]


def report(ways: list[str], errors: np.ndarray) -> str:
    """Format the errors.

    Parameters
    ----------
    ways : list of str
    errors : (photos, ways, metrics) ndarray

    Returns
    -------
    str
        A Markdown table.
    """
    middles = np.median(bootstrap_samples(errors), axis=1)
    low, high = interval(middles / middles[:, :1])
    plain = np.median(errors, axis=0)
    means = np.exp(np.log(errors / errors[:, :1]).mean(axis=0))
    lines = ["| way | " + " | ".join(METRICS) + " |", "|---" * (len(METRICS) + 1) + "|"]
    for k, way in enumerate(ways):
        cells = [
            f"{plain[k, m]:.3g}, {plain[k, m] / plain[0, m]:.2f} "
            f"({low[k, m]:.2f}-{high[k, m]:.2f}); {means[k, m]:.2f}"
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
    add("--count", type=int, default=24, help="photos (default: %(default)s)")
    add("--ways", default="natural,photo", help="default: %(default)s")
    add("--balance", choices=BALANCES, default=BALANCES[0], help="default: %(default)s")
    add("--seed", type=int, default=0, help="of the photos")
    add("--workers", type=int, default=1, help="processes (default: %(default)s)")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    ways = given.ways.split(",")
    try:
        scenes = balanced_scenes(
            given.world, given.panoramas, given.count, given.seed, given.balance
        )
    except InputError as error:
        parser.error(str(error))
    with ProcessPoolExecutor(given.workers) as pool:
        errors = []
        for found in pool.map(partial(errors_of, ways=ways), scenes):
            errors.append(found)
            print(len(errors), np.round(found, 4).tolist(), flush=True)
    if given.json:
        given.json.write_text(json.dumps({"ways": ways, "errors": errors}), encoding="utf-8")
    casts = np.quantile([scene.cast for scene in scenes], (0.5, 0.9))
    print(report(ways, np.array(errors)))
    print(f"\nchannels of the light: median {casts[0]:.2f}, 90 % {casts[1]:.2f}")


if __name__ == "__main__":
    main()
