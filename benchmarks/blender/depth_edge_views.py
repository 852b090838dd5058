"""Views of bodies of known depth that no network has learned from, and what decomposing finds.

Bodies of all kinds of `training.world.bodies.built`, with numbers beyond those of any world, traced
by a parallel projection, painted at random and lit by panoramas that are kept for judging
(`training.world`), with noise; then decomposed as users do. The first three of each kind choose,
the next three report.

Limits: 160 pixels, of which the scene network sees 112. Results in FOLDER are kept.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import isc_core
from isc_core.decomposition.settings import Settings
from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.io.npy import read_arrays
from isc_core.networks.scene_network import predict_scene
from training.world import views
from training.world.bodies.body import Source
from training.world.bodies.built import CREDIT, KINDS
from training.world.bodies.sources import BodyReference
from training.world.environments import read_panoramas
from training.world.lit_pictures import make_pictures
from training.world.patterns import Atlas, make_atlas
from training.world.pictures import Bank, bank_of, stacked
from training.world.recipes import Shares, draw_recipe
from training.world.view_batches import batch_of, prepared

CHOSEN_ON, REPORTED = range(3), range(3, 6)
_FIRST = 5000  # worlds have less than a thousand bodies of a kind
_PATTERNS, _SEED, _NOISE, _BRIGHT = 60, 5, 0.004, 0.85
_HALF = views.SIDE / 2


@dataclass(frozen=True, eq=False)
class SeenBody:
    """A body, its photo and what is found in it.

    Attributes
    ----------
    light : (H, W, 3) ndarray
        The photo, linear.
    mask : (H, W) bool ndarray
    depth : (H, W) ndarray
        True height in pixels.
    edge : (H, W) ndarray
        The network's probability that the depth jumps.
    height, normal : (H, W), (H, W, 3) ndarray
        Recovered.
    vertices, faces : (V, 3), (F, 3) ndarray
        The body in pixels, from the middle of the photo.
    """

    light: np.ndarray
    mask: np.ndarray
    depth: np.ndarray
    edge: np.ndarray
    height: np.ndarray
    normal: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray

    @property
    def length(self) -> int:
        """Pixels of the longer side."""
        return int((np.ptp(np.argwhere(self.mask), axis=0) + 1).max())


def seen_bodies(numbers: range, folder: Path, panoramas: Path) -> Iterator[SeenBody]:
    """See bodies of all kinds.

    Parameters
    ----------
    numbers : range
        Of each kind.
    folder : Path
        Where results are kept.
    panoramas : Path
        Folder of panoramas.

    Yields
    ------
    SeenBody
        Without those that cannot be traced or decomposed.
    """
    held_out = [one.radiance for one in read_panoramas(panoramas) if one.held_out]
    atlas = make_atlas(_SEED, _PATTERNS)
    bank = bank_of(held_out, atlas)
    for number in numbers:
        for kind in KINDS:
            path = folder / f"{kind}_{number}.npz"
            if not path.is_file():
                try:
                    arrays = _seen(kind, number, atlas, bank, len(held_out))
                except InputError as error:
                    print(f"{kind} {number}: {error}", flush=True)
                    continue
                with new_file(path) as partial, partial.open("wb") as file:
                    np.savez(file, **arrays)
            yield SeenBody(**read_arrays(path))


def _seen(
    kind: str, number: int, atlas: Atlas, bank: Bank, environments: int
) -> dict[str, np.ndarray]:
    rng = np.random.default_rng([17, number, KINDS.index(kind)])
    name = f"{Source.BUILT}/{kind}"
    made = BodyReference(name, Source.BUILT, CREDIT, part=kind, number=_FIRST + number)
    bodies = made.load()
    if not bodies:
        raise InputError("no object passes the screening")
    side, up = views.random_side(rng)
    placed = views.in_picture(bodies[0].mesh.rotated(side), np.inf)
    view = views.view_of(kind, str(Source.BUILT), placed, np.inf, rng, up)
    if view is None:
        raise InputError("too little is seen of it")
    ready = prepared(view)
    recipe = draw_recipe(ready.directions, ready.up, atlas, np.arange(environments), rng, Shares())
    lit = make_pictures(batch_of([ready]), stacked([recipe]), bank)
    layers = lit.layers[0].float().permute(1, 2, 0).numpy()
    mask = view.mask
    light = layers[..., :3] + layers[..., 3:6]
    light *= _BRIGHT / max(float(np.percentile(light[mask].max(-1), 99)), 1e-9)
    light = np.clip(light + rng.normal(0, _NOISE, light.shape), 0, 1).astype(np.float32)
    found = isc_core.decompose(light, mask, settings=Settings(max_size=0))
    return {
        "light": light,
        "mask": mask,
        "depth": np.where(mask, layers[..., 12] * _HALF, 0),
        "edge": predict_scene(light, mask).edge,
        "height": found.height,
        "normal": found.normal,
        "vertices": placed.vertices * _HALF,
        "faces": placed.faces,
    }
