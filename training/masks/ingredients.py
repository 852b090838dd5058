"""Ingredients of composites: cut-outs of rendered objects, panoramas, and patterns of tables.

  python -m training.masks.ingredients WORLD --panoramas DIR -o FOLDER

Problem: the mask network is trained on millions of photos. Rendering an object takes as long as a
training step, pasting its cut-out a hundredth of that. Objects are therefore rendered once and
pasted many times, each time at another place, at another size, in front of another background.

FOLDER/learned.npz, for training, and FOLDER/judged.npz, with held-out objects and panoramas, are
compressed (`training.masks.packs`), so that they can be copied to another machine. `--first 3`
after `--rounds 3` renders the objects in other lights than the previous run, for a second folder.

Limits: the light on an object is not that of the background in front of which it is pasted.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from isc_core.errors import InputError

from ..networks.scene_batches import World, read_world
from ..world.backgrounds import panoramas_in
from ..world.camera import encoded_srgb
from ..world.files import Split
from ..world.lit_pictures import make_pictures
from ..world.pictures import stacked
from ..world.recipes import Shares, draw_recipe
from ..world.view_batches import batch_of
from .packs import SUFFIX, Ingredients

SIDE = 128  # of a cut-out, pixels
LENGTH = 120  # of the object in it, pixels
_BATCH = 8  # views rendered together
_WHITE = 0.99  # quantile of an object's light that becomes white
_MIN_COVER = 0.02  # of an image: smaller objects are left out
SETS = ("learned", "judged")  # names of the files for training, and of the held-out set
_PATTERNS = 600


def lit_cutouts(
    world: World,
    split: Split,
    environments: np.ndarray,
    rng: np.random.Generator,
    side: int = SIDE,
) -> np.ndarray:
    """Render every view, and cut out the objects.

    Parameters
    ----------
    world : World
    split : Split
    environments : (N,) ndarray of int
        Indices of the bank's environments to use.
    rng : numpy.random.Generator
    side : int
        Of a cut-out, pixels.

    Returns
    -------
    (N, 4, side, side) uint8 ndarray
        As `packs.Ingredients.cutouts`.
    """
    views, shares, found = world.views[split], Shares(), list[np.ndarray]()
    for start in range(0, len(views), _BATCH):
        some = views[start : start + _BATCH]
        recipes = stacked(
            [
                draw_recipe(one.directions, one.up, world.atlas, environments, rng, shares)
                for one in some
            ]
        )
        lit = make_pictures(batch_of(some), recipes, world.bank)
        light = (lit.layers[:, :3] + lit.layers[:, 3:6]).float()
        found += cut_out(light, lit.cover.float(), side)
    return np.stack(found)


def cut_out(light: torch.Tensor, cover: torch.Tensor, side: int = SIDE) -> Iterator[np.ndarray]:
    """Scale objects to one size, and convert them to 8 bits.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
        Linear.
    cover : (B, 1, H, W) tensor
    side : int
        Of a cut-out, pixels.

    Yields
    ------
    (4, side, side) uint8 ndarray
        One per object, in order; objects that are too small are left out.
    """
    for image, covered in zip(light, cover, strict=True):
        rows, columns = torch.nonzero(covered[0] > 0.5, as_tuple=True)
        if len(rows) < _MIN_COVER * covered.numel():
            continue
        white = torch.quantile(image.amax(0)[covered[0] > 0.5], _WHITE).clamp(min=1e-6)
        layers = torch.cat([(image / white).clamp(max=1) * covered, covered])
        part = layers[:, rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
        factor = LENGTH * side / SIDE / max(part.shape[1:])
        size = [max(round(n * factor), 1) for n in part.shape[1:]]
        small = functional.interpolate(part[None], size, mode="bilinear", antialias=True)[0]
        placed = torch.zeros(4, side, side)
        top, left = (side - size[0]) // 2, (side - size[1]) // 2
        placed[:, top : top + size[0], left : left + size[1]] = small
        seen = placed[3:].clamp(min=1e-3)
        colours = torch.where(placed[3:] > 1e-3, placed[:3] / seen, torch.zeros(()))
        coded = torch.cat([encoded_srgb(colours.clamp(0, 1)), placed[3:]])
        yield (255 * coded).round().clamp(0, 255).byte().numpy()


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--rounds", type=int, default=1, help="renderings of each view (default: %(default)s)")
    add("--first", type=int, default=0, help="index of the first (default: %(default)s)")
    add("--seed", type=int, default=0, help="default: %(default)s")
    add("-o", "--output", type=Path, required=True, metavar="FOLDER", help="where to write")
    given = parser.parse_args()
    try:
        world = read_world(
            [given.world], given.panoramas, (Split.TRAIN, Split.UNSEEN_BODY), given.seed
        )
        panoramas = [panoramas_in(given.panoramas, k == 1) for k in range(2)]
    except InputError as error:
        parser.error(str(error))
    given.output.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(given.seed)
    environments = (world.training_environments, world.held_out_environments)
    splits = zip(SETS, (Split.TRAIN, Split.UNSEEN_BODY), environments, strict=True)
    for k, (name, split, usable) in enumerate(splits):
        rounds = range(given.first, given.first + given.rounds)
        cutouts = [
            lit_cutouts(world, split, usable, np.random.default_rng([given.seed, k, n]))
            for n in rounds
        ]
        made = Ingredients(np.concatenate(cutouts), panoramas[k], world.atlas.maps[:_PATTERNS])
        path = given.output / f"{name}{SUFFIX}"
        print(f"{path}: {len(made.cutouts)} cut-outs, {made.write(path) / 1e6:.1f} MB", flush=True)


if __name__ == "__main__":
    main()
