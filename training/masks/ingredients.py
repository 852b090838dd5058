"""What composites are made of: bodies lit and cut out, panoramas, and patterns of tables.

  python -m training.masks.ingredients WORLD --panoramas DIR -o FOLDER

Problem: the mask network sees millions of photos of objects before other objects. Lighting a body
takes as long as a step of the network, pasting it a hundredth of that: bodies are lit once and
pasted many times, each time elsewhere, in another size, before another background.

FOLDER/learned.npz and FOLDER/judged.npz are compressed (`training.masks.packs`) so that they may
travel to another machine. `--first 3` after `--rounds 3` lights the bodies in other ways than the
run before, for a second folder beside the first.

Limits: a body is not lit by the background that it is pasted before.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from isc_core.errors import InputError
from isc_core.photo import read_linear

from ..networks.scene_batches import World, read_world
from ..world.camera import encoded_srgb
from ..world.environments import read_panoramas
from ..world.files import Split
from ..world.lit_pictures import make_pictures
from ..world.pictures import stacked
from ..world.recipes import Shares, draw_recipe
from ..world.view_batches import batch_of
from .packs import SUFFIX, Ingredients

SIDE = 128  # pixels of a picture
LENGTH = 120  # longer side of a body in it
_LIT = 8  # views lit together
_WHITE = 0.99  # share of a body's pixels that are darker than white
_LEAST_COVER = 0.02  # of a picture: smaller bodies are left out
SETS = ("learned", "judged")  # for training, and held out
ROWS = 256  # of panoramas
_BRIGHTEST = 6e4  # that half floats hold
_FILES = (".exr", ".hdr")
_PATTERNS = 600


def lit_bodies(
    world: World,
    split: Split,
    environments: np.ndarray,
    rng: np.random.Generator,
    side: int = SIDE,
) -> np.ndarray:
    """Light every view and cut the bodies out.

    Parameters
    ----------
    world : World
    split : Split
    environments : (N,) ndarray of int
        Those of the bank that may light.
    rng : numpy.random.Generator
    side : int
        Pixels of a picture.

    Returns
    -------
    (N, 4, side, side) uint8 ndarray
        As `packs.Ingredients.bodies`.
    """
    views, shares, found = world.views[split], Shares(), list[np.ndarray]()
    for start in range(0, len(views), _LIT):
        some = views[start : start + _LIT]
        recipes = stacked(
            [draw_recipe(one.directions, world.atlas, environments, rng, shares) for one in some]
        )
        lit = make_pictures(batch_of(some), recipes, world.bank)
        light = (lit.layers[:, :3] + lit.layers[:, 3:6]).float()
        found += cut_out(light, lit.cover.float(), side)
    return np.stack(found)


def cut_out(light: torch.Tensor, cover: torch.Tensor, side: int = SIDE) -> Iterator[np.ndarray]:
    """Bring bodies to one size and to 8 bits.

    Parameters
    ----------
    light : (B, 3, H, W) tensor
        Linear.
    cover : (B, 1, H, W) tensor
    side : int
        Pixels of a picture.

    Yields
    ------
    (4, side, side) uint8 ndarray
        Of those that are not tiny.
    """
    for picture, body in zip(light, cover, strict=True):
        rows, columns = torch.nonzero(body[0] > 0.5, as_tuple=True)
        if len(rows) < _LEAST_COVER * body.numel():
            continue
        white = torch.quantile(picture.amax(0)[body[0] > 0.5], _WHITE).clamp(min=1e-6)
        layers = torch.cat([(picture / white).clamp(max=1) * body, body])
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


def panoramas_in(folder: Path, seed: int, held_out: bool) -> np.ndarray:
    """Read panoramas at one size, with the split of `read_panoramas`.

    Parameters
    ----------
    folder : Path
    seed : int
        Chooses which are held out.
    held_out : bool
        Whether to read those, or the others.

    Returns
    -------
    (N, ROWS, 2 ROWS, 3) float16 ndarray
        Linear.

    Raises
    ------
    InputError
        If there is none of the set, or one cannot be used.
    """
    wanted = {one.name for one in read_panoramas(folder, seed) if one.held_out == held_out}
    size, found = (ROWS, 2 * ROWS), list[np.ndarray]()
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in _FILES and path.stem in wanted:
            light = torch.from_numpy(read_linear(path, "linear")).permute(2, 0, 1)[None].float()
            light = functional.interpolate(light, size, mode="bilinear", antialias=True)[0]
            found.append(light.clamp(max=_BRIGHTEST).permute(1, 2, 0).numpy().astype(np.float16))
    if not found:
        raise InputError(f"{folder} has too few panoramas to hold one out: six are enough")
    return np.stack(found)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--rounds", type=int, default=1, help="lights of each view (default: %(default)s)")
    add("--first", type=int, default=0, help="number of the first (default: %(default)s)")
    add("--seed", type=int, default=0, help="default: %(default)s")
    add("-o", "--output", type=Path, required=True, metavar="FOLDER", help="where to write")
    given = parser.parse_args()
    try:
        world = read_world(
            [given.world], given.panoramas, (Split.TRAIN, Split.UNSEEN_BODY), given.seed
        )
        panoramas = [panoramas_in(given.panoramas, given.seed, k == 1) for k in range(2)]
    except InputError as error:
        parser.error(str(error))
    given.output.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(given.seed)
    environments = (world.training_environments, world.held_out_environments)
    splits = zip(SETS, (Split.TRAIN, Split.UNSEEN_BODY), environments, strict=True)
    for k, (name, split, usable) in enumerate(splits):
        rounds = range(given.first, given.first + given.rounds)
        bodies = [
            lit_bodies(world, split, usable, np.random.default_rng([given.seed, k, n]))
            for n in rounds
        ]
        made = Ingredients(np.concatenate(bodies), panoramas[k], world.atlas.maps[:_PATTERNS])
        path = given.output / f"{name}{SUFFIX}"
        print(f"{path}: {len(made.bodies)} bodies, {made.write(path) / 1e6:.1f} MB", flush=True)


if __name__ == "__main__":
    main()
