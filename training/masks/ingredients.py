"""What composites are made of: lit bodies cut out, and backgrounds, kept as pictures of 8 bits.

  python -m training.masks.ingredients WORLD --panoramas DIR -o FOLDER

Problem: the mask network sees a hundred thousand photos of things before other things. Lighting a
body takes as long as a step of the network, pasting it a hundredth of that: bodies are lit once and
pasted many times, each time elsewhere, in another size, before another background.

Limits: a body is not lit by the background that it is pasted before.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.io.npy import read_array

from ..networks.scene_batches import World, read_world
from ..world.camera import encoded_srgb
from ..world.files import Split
from ..world.lit_pictures import make_pictures
from ..world.pictures import stacked
from ..world.recipes import Shares, draw_recipe
from ..world.view_batches import batch_of
from .backgrounds import background, read_crops

SIDE = 128  # pixels of a picture
LENGTH = 120  # longer side of a body in it
_LIT = 8  # views lit together
_WHITE = 0.99  # share of a body's pixels that are darker than white
_LEAST_COVER = 0.02  # of a picture: smaller bodies are left out
BACKGROUNDS = 3000
SETS = ("learned", "judged")


@dataclass(frozen=True)
class Ingredients:
    """Pictures to compose photos from.

    Attributes
    ----------
    bodies : (N, 4, SIDE, SIDE) uint8 ndarray
        sRGB and cover; the longer side of each body is `LENGTH` pixels.
    backgrounds : (M, 3, side, side) uint8 ndarray
        sRGB.
    """

    bodies: np.ndarray
    backgrounds: np.ndarray

    @classmethod
    def read(cls, folder: Path, name: str) -> "Ingredients":
        """Read what `main` wrote.

        Parameters
        ----------
        folder : Path
        name : {"learned", "judged"}

        Returns
        -------
        Ingredients

        Raises
        ------
        InputError
            If the folder has no such files.
        """
        return cls(
            *(read_array(folder / f"{part}_{name}.npy") for part in ("bodies", "backgrounds"))
        )


def lit_bodies(
    world: World,
    split: Split,
    environments: np.ndarray,
    rounds: int,
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
    rounds : int
        How often each view is lit, each time in other light and paint.
    rng : numpy.random.Generator
    side : int
        Pixels of a picture.

    Returns
    -------
    (N, 4, side, side) uint8 ndarray
        As `Ingredients.bodies`.
    """
    views, shares, found = world.views[split], Shares(), list[np.ndarray]()
    for _ in range(rounds):
        for start in range(0, len(views), _LIT):
            some = views[start : start + _LIT]
            recipes = stacked(
                [
                    draw_recipe(one.directions, world.atlas, environments, rng, shares)
                    for one in some
                ]
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


def _write(path: Path, values: np.ndarray) -> None:
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.save(file, values)
    print(f"{path}: {len(values)}", flush=True)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--rounds", type=int, default=1, help="lights of each view (default: %(default)s)")
    add("--seed", type=int, default=0, help="default: %(default)s")
    add("-o", "--output", type=Path, required=True, metavar="FOLDER", help="where to write")
    given = parser.parse_args()
    try:
        world = read_world([given.world], given.panoramas, (Split.TRAIN, Split.BODY), given.seed)
        crops = read_crops(given.panoramas, given.seed)
    except InputError as error:
        parser.error(str(error))
    given.output.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(given.seed)
    splits = zip(SETS, (Split.TRAIN, Split.BODY), (world.learned, world.judged), strict=True)
    for k, (name, split, environments) in enumerate(splits):
        rng = np.random.default_rng([given.seed, k])
        panoramas = [one.radiance for one in crops if one.judged == (name == "judged")]
        count = BACKGROUNDS if name == "learned" else BACKGROUNDS // 5
        grounds = np.stack([background(panoramas, world.atlas, rng) for _ in range(count)])
        _write(given.output / f"backgrounds_{name}.npy", grounds)
        bodies = lit_bodies(world, split, environments, given.rounds, rng)
        _write(given.output / f"bodies_{name}.npy", bodies)


if __name__ == "__main__":
    main()
