"""Fit the network of `isc_core.networks.scene_network`.

  python -m training.networks.scene_network WORLD... --panoramas DIR [--weights NPZ]
  [--device cuda] [--minutes N] -o SCENE.npz

WORLD are folders of `isc world build`. Every photo is lit anew (`training.world.samples`), so none
is seen twice. `--weights` starts from an archive that an earlier run wrote, `--resume` continues an
interrupted one. Held-out bodies under held-out panoramas are measured every thousand steps.

Equation: see `training.networks.scene_module`.

Citation: see `training.loop`.

Limits: a batch consists of views of about one size, so that lighting wastes little.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from isc_core.errors import InputError
from isc_core.io.npy import read_arrays

from ..loop import Schedule, add_run_arguments, fit, run_options
from ..world.environments import read_panoramas
from ..world.files import Split, read_patterns, views_in
from ..world.invented_environments import invented_room, invented_sky, studio
from ..world.lighting import PreparedView, prepared
from ..world.patterns import Atlas
from ..world.pictures import Bank, bank_of
from ..world.recipes import Shares
from ..world.samples import Draw, Sample, draw_batch, finish_batch
from .scene_module import WIDTHS, SceneNetworkModule

SCHEDULE = Schedule(
    rate=1.5e-3, head_rate=1e-3, weight_decay=1e-2, warm_up=200, average_limit=0.998
)
_INVENTED = 60  # surroundings of each of three kinds
_OFTEN = 3  # panoramas are drawn so many times as often again
_ABLATIONS: dict[str, dict[str, Any]] = {
    "camera": {},
    "prints": {"printed": 0.0},
    "lamps": {"lights": (0.3, 0.7, 0, 0, 0)},
    "harmonics": {"lights": (0, 0.32, 0.3, 0.14, 0.24)},
    "gloss": {"matte": 1.0, "kinds": (1, 0, 0)},
}
_ALIKE = 400  # views of a batch are so near in size: less is filled up


@dataclass(frozen=True)
class SceneBatches:
    """Draws batches of photos.

    Attributes
    ----------
    views : list of PreparedView
        Not empty, ordered by size.
    atlas : Atlas
    environments : (N,) ndarray of int
        Those of the bank that may be used.
    size : int
        Photos of a batch.
    shares : Shares
    plain_camera : bool
    finish : Bank or None
        Light and photograph right here, in the worker process; None: leave it to the device.
    """

    views: list[PreparedView]
    atlas: Atlas
    environments: np.ndarray
    size: int
    shares: Shares
    plain_camera: bool = False
    finish: Bank | None = None

    def __call__(self, rng: np.random.Generator) -> Draw | Sample:
        """Draw a batch.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        Draw or Sample
        """
        around = rng.integers(len(self.views)) + rng.integers(-_ALIKE, _ALIKE, self.size)
        chosen = [self.views[int(k) % len(self.views)] for k in around]
        draw = draw_batch(
            chosen, self.atlas, self.environments, rng, self.shares, self.plain_camera
        )
        return draw if self.finish is None else finish_batch(draw, self.finish)


@dataclass(frozen=True)
class World:
    """All that photos are drawn from.

    Attributes
    ----------
    views : dict of Split to list of PreparedView
        Ordered by size.
    atlas : Atlas
    bank : Bank
    learned, judged : (N,) ndarray of int
        Surroundings to learn from, and panoramas that are kept for judging.
    """

    views: dict[Split, list[PreparedView]]
    atlas: Atlas
    bank: Bank
    learned: np.ndarray
    judged: np.ndarray


def read_world(
    folders: Sequence[Path], panoramas: Path, splits: Sequence[Split], seed: int
) -> World:
    """Read views and panoramas, and invent the rest.

    Parameters
    ----------
    folders : sequence of Path
        Worlds.
    panoramas : Path
    splits : sequence of Split
        What to read.
    seed : int

    Returns
    -------
    World

    Raises
    ------
    InputError
        If a folder is no world, or holds nothing to learn from.
    """
    views = {
        split: sorted(
            (prepared(view) for folder in folders for view in views_in(folder, split)),
            key=lambda view: len(view.index),
        )
        for split in splits
    }
    if not all(views.values()):
        raise InputError(f"{folders[0]} has no views to learn from: build more bodies")
    rng, found = np.random.default_rng([seed, 7]), read_panoramas(panoramas, seed)
    invented = [
        make(rng) for _ in range(_INVENTED) for make in (invented_room, invented_sky, studio)
    ]
    atlas = read_patterns(folders[0])
    bank = bank_of([*(one.radiance for one in found), *invented], atlas)
    judged = np.array([one.judged for one in found] + [False] * len(invented))
    photographed = np.flatnonzero(~judged[: len(found)])
    learned = np.concatenate([np.flatnonzero(~judged), np.repeat(photographed, _OFTEN)])
    return World(views, atlas, bank, learned, np.flatnonzero(judged))


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("worlds", type=Path, nargs="+", metavar="WORLD", help="folders of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas, .exr or .hdr")
    add("--weights", type=Path, metavar="NPZ", help="start from the weights of an archive")
    add("--widths", type=int, nargs="+", default=WIDTHS, metavar="N", help="channels by level")
    add("--without", nargs="+", default=[], choices=sorted(_ABLATIONS), help="leave out, to ablate")
    add_run_arguments(parser, steps=100_000, batch=32)
    arguments = parser.parse_args()
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    world = read_world(
        arguments.worlds, arguments.panoramas, (Split.TRAIN, Split.BODY), options.seed
    )
    network = SceneNetworkModule(tuple(arguments.widths))
    if arguments.weights is not None:
        network.load_arrays(dict(read_arrays(arguments.weights)))
    shares = Shares()
    for name in arguments.without:
        shares = replace(shares, **_ABLATIONS[name])
    on_cpu = options.device == "cpu"
    draw = SceneBatches(
        world.views[Split.TRAIN],
        world.atlas,
        world.learned,
        options.batch,
        shares,
        "camera" in arguments.without,
        world.bank if on_cpu else None,
    )
    held_out = replace(draw, views=world.views[Split.BODY], environments=world.judged)
    bank = world.bank.to(options.device)
    prepare = (
        (lambda drawn: drawn)
        if on_cpu
        else (lambda drawn: finish_batch(drawn.to(options.device), bank))
    )
    fit(network, draw, SCHEDULE, options, held_out, prepare)


if __name__ == "__main__":
    main()
