"""Composites of held-out bodies and panoramas, larger than the network sees them.

Bodies and panoramas are those that every fit leaves out. They are halved: part A chooses
thresholds, part B is the test set. Masked photos of real objects can replace the bodies.

Limits: bodies are traced at 160 pixels and panoramas have 512 columns: both are soft.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from isc_core.networks.mask_network import Count
from isc_core.photo import read_photo

from ..networks.scene_batches import read_world
from ..world.files import Split
from .composites import CompositeDraws, Composites
from .ingredients import cut_out, lit_bodies, panoramas_in
from .packs import Ingredients

SIDE = 320  # pixels of a composite's longer side
_PICTURE = 256  # of a body
_BATCH = 8
PARTS = ("A", "B")


@dataclass(frozen=True)
class HeldOut:
    """A composite with its truth.

    Attributes
    ----------
    light : (H, W, 3) float32 ndarray
        Linear, 1 is white.
    cover : (H, W) float32 ndarray
        Of the target; of all objects, if there are several.
    count : Count
    """

    light: np.ndarray
    cover: np.ndarray
    count: Count


def held_out_ingredients(
    world: Path, panoramas: Path, part: str, photos: Path | None = None, seed: int = 0
) -> Ingredients:
    """Light held-out bodies, and read held-out panoramas.

    Parameters
    ----------
    world, panoramas : Path
    part : {"A", "B"}
    photos : Path, optional
        Folder of masked photos to use in place of the bodies.
    seed : int

    Returns
    -------
    Ingredients

    Raises
    ------
    InputError
        If a folder cannot be used.
    """
    half, rng = PARTS.index(part), np.random.default_rng([seed, 11, PARTS.index(part)])
    torch.manual_seed(seed)
    found = read_world([world], panoramas, (Split.UNSEEN_BODY,), seed)
    if photos is not None:
        pictures = [masked_picture(path) for path in sorted(photos.glob("*.png"))]
    else:
        found.views[Split.UNSEEN_BODY][:] = found.views[Split.UNSEEN_BODY][half::2]
        pictures = list(
            lit_bodies(found, Split.UNSEEN_BODY, found.held_out_environments, rng, _PICTURE)
        )
    kept = panoramas_in(panoramas, seed, held_out=True)[half::2]
    return Ingredients(np.stack(pictures), kept, found.atlas.maps)


def masked_picture(path: Path) -> np.ndarray:
    """Read a masked photo as a body of composites.

    Parameters
    ----------
    path : Path

    Returns
    -------
    (4, 256, 256) uint8 ndarray
        As of `Ingredients.bodies`.
    """
    photo = read_photo(path)
    light = torch.from_numpy(photo.image).permute(2, 0, 1)[None]
    return next(cut_out(light, torch.from_numpy(photo.mask)[None, None].float(), _PICTURE))


def held_out_composites(
    ingredients: Ingredients, count: Count, number: int, seed: int
) -> Iterator[HeldOut]:
    """Compose photos.

    Parameters
    ----------
    ingredients : Ingredients
    count : Count
        How many objects each shows.
    number : int
        Of photos.
    seed : int

    Yields
    ------
    HeldOut
    """
    shares = tuple(float(kind == count) for kind in Count)
    compose = Composites(ingredients, CompositeDraws(_BATCH, hinted=0, shares=shares), SIDE)
    rng, made = np.random.default_rng([seed, int(count)]), 0
    torch.manual_seed(seed)
    while made < number:
        batch = compose(rng)
        for k in range(min(_BATCH, number - made)):
            frame = batch.frame[k, 0].numpy() > 0
            place = np.ix_(frame.any(1), frame.any(0))
            light = batch.photo[k].permute(1, 2, 0).numpy()[place]
            yield HeldOut(light, batch.mask[k, 0].numpy()[place], count)
            made += 1
