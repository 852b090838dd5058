"""Batches of photos from worlds, panoramas and patterns, for training and evaluation.

Limits: views lit together are of about one size, so that lighting wastes little; the pool mixes
them.
"""

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path

import numpy as np

from isc_core.cli.interface.values import positive
from isc_core.errors import InputError
from isc_core.io.npy import read_arrays

from ..loop import Net, RunOptions, Schedule, fit, photo_side
from ..world.environments import read_panoramas
from ..world.files import Split, read_patterns, views_in
from ..world.pack import PackedWorld, read_pack
from ..world.patterns import Atlas
from ..world.pictures import Bank, bank_of
from ..world.procedural_environments import procedural_room, procedural_sky, studio
from ..world.recipes import Shares
from ..world.samples import OUTPUT, Alteration, Draw, PhotoRenderer, Sample, draw_batch
from ..world.view_batches import PreparedView, ViewStore, prepared

_PROCEDURAL = 60  # environments of each of three kinds
_OFTEN = 3  # panoramas are drawn so many times as often again
PHOTOS = 8  # taken of each lit view, on average: lighting takes three times as long
POOL = 512  # lit views; on a GPU, which lights more at once, several times as many
_GPU_POOL, _GPU_EVERY = 4096, 4
_ALIKE = 400  # views lit together are so near in size: less is filled up


@dataclass(frozen=True, eq=False)
class SceneDraws:
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
    photos : int
        Taken of each lit view, on average.
    every : int
        Views are lit for one batch in so many, for all of these at once.
    calls : iterator of int
        Counts the batches; a copy counts its own.
    """

    views: list[PreparedView]
    atlas: Atlas
    environments: np.ndarray
    size: int
    shares: Shares
    plain_camera: bool = False
    photos: int = PHOTOS
    every: int = 1
    calls: Iterator[int] = field(init=False, default_factory=count)

    def __call__(self, rng: np.random.Generator) -> Draw:
        """Draw a batch.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        Draw
        """
        fresh = max(1, -(-self.size * self.every // self.photos))
        fresh = 0 if next(self.calls) % self.every else fresh
        around = rng.integers(len(self.views)) + rng.integers(-_ALIKE, _ALIKE, fresh)
        return draw_batch(
            self.views,
            around % len(self.views),
            self.size,
            self.atlas,
            self.environments,
            rng,
            self.shares,
            self.plain_camera,
        )


class SceneBatches:
    """Draws and finishes batches on one device.

    Parameters
    ----------
    draw : SceneDraws
    bank : Bank
        On the CPU.
    side : int
        Of the photos, pixels.
    alter : Alteration, optional
        See `PhotoRenderer`.
    device : str
        Where photos are made.
    """

    def __init__(
        self,
        draw: SceneDraws,
        bank: Bank,
        side: int = OUTPUT,
        alter: Alteration | None = None,
        device: str = "cpu",
    ) -> None:
        self._draw, self._device = draw, device
        pool = POOL if device == "cpu" else _GPU_POOL
        self._renderer = PhotoRenderer(bank.to(device), pool, side, alter)
        self._views = ViewStore(draw.views, device)

    def __call__(self, rng: np.random.Generator) -> Sample:
        """Return the next batch.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        Sample
        """
        return self.finished(self._draw(rng))

    def finished(self, drawn: Draw) -> Sample:
        """Make the photos of a draw.

        Parameters
        ----------
        drawn : Draw
            On the CPU.

        Returns
        -------
        Sample
            On the device.
        """
        return self._renderer(drawn.to(self._device), self._views)


@dataclass(frozen=True, eq=False)
class World:
    """The data from which photos are drawn.

    Attributes
    ----------
    views : dict of Split to list of PreparedView
        Ordered by size.
    atlas : Atlas
    bank : Bank
    training_environments, held_out_environments : (N,) ndarray of int
        Of the bank; those of training in the frequency in which they are drawn.
    """

    views: dict[Split, list[PreparedView]]
    atlas: Atlas
    bank: Bank
    training_environments: np.ndarray
    held_out_environments: np.ndarray


def read_world(
    paths: Sequence[Path], panoramas: Path | None, splits: Sequence[Split], seed: int
) -> World:
    """Read views and panoramas, and draw procedural environments.

    Parameters
    ----------
    paths : sequence of Path
        Folders of worlds, and packs.
    panoramas : Path or None
        Folder of panoramas; None: those of the first pack.
    splits : sequence of Split
        What to read.
    seed : int
        Of the procedural environments.

    Returns
    -------
    World

    Raises
    ------
    InputError
        If a folder is no world, there are no views, or no panorama can be held out.
    """
    with ThreadPoolExecutor() as pool:  # unpacking leaves other threads alone
        packs = list(pool.map(read_pack, [path for path in paths if path.is_file()]))
    folders = [path for path in paths if not path.is_file()]
    views = {split: _prepared_views(packs, folders, split) for split in splits}
    if not all(views.values()):
        raise InputError(f"{paths[0]} has no views for training: build more bodies")
    if panoramas is None and not packs:
        raise InputError("name a folder of panoramas with --panoramas; only packs have their own")
    found = packs[0].panoramas if panoramas is None else read_panoramas(panoramas)
    rng = np.random.default_rng([seed, 7])
    procedural = [
        make(rng) for _ in range(_PROCEDURAL) for make in (procedural_room, procedural_sky, studio)
    ]
    atlas = packs[0].atlas if packs else read_patterns(folders[0])
    bank = bank_of([*(one.radiance for one in found), *procedural], atlas)
    held_out = np.array([one.held_out for one in found] + [False] * len(procedural))
    if not held_out.any():
        raise InputError("there are too few panoramas to hold one out: six are enough")
    photographed = np.flatnonzero(~held_out[: len(found)])
    training = np.concatenate([np.flatnonzero(~held_out), np.repeat(photographed, _OFTEN)])
    return World(views, atlas, bank, training, np.flatnonzero(held_out))


def _prepared_views(
    packs: Sequence[PackedWorld], folders: Sequence[Path], split: Split
) -> list[PreparedView]:
    """Views ordered by size."""
    found = chain(
        *(pack.views[split] for pack in packs), *(views_in(folder, split) for folder in folders)
    )
    with ThreadPoolExecutor() as pool:
        return sorted(pool.map(prepared, found), key=lambda view: len(view.index))


def add_photo_arguments(parser: argparse.ArgumentParser, rate: float) -> None:
    """Add the options that programs which train on photos of worlds have in common.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    rate : float
        Default learning rate.
    """
    add = parser.add_argument
    add("worlds", type=Path, nargs="+", metavar="WORLD", help="folders or packs of isc world")
    add("--panoramas", type=Path, metavar="DIR", help="panoramas (default: those of a pack)")
    add("--weights", type=Path, metavar="NPZ", help="start from the weights of an archive")
    add(
        "--side",
        type=photo_side,
        default=OUTPUT,
        metavar="PX",
        help="of photos (default: %(default)s)",
    )
    add("--rate", type=positive, default=rate, help="learning rate (default: %(default)s)")


def read_given(
    arguments: argparse.Namespace, seed: int
) -> tuple[World, dict[str, np.ndarray] | None]:
    """Read the world and the weights that a command line names.

    Parameters
    ----------
    arguments : argparse.Namespace
        With what `add_photo_arguments` added.
    seed : int

    Returns
    -------
    world : World
        Views of training and held-out bodies.
    weights : dict of str to ndarray or None
        What the fit starts from.

    Raises
    ------
    InputError
        If a file cannot be read, a folder is no world, or there are no views.
    """
    given: Path | None = arguments.weights
    weights = None if given is None else dict(read_arrays(given))
    splits = (Split.TRAIN, Split.UNSEEN_BODY)
    return read_world(arguments.worlds, arguments.panoramas, splits, seed), weights


def fit_to_photos(
    network: Net,
    draw: SceneDraws,
    held_out: SceneDraws,
    bank: Bank,
    side: int,
    schedule: Schedule,
    options: RunOptions,
    alter: Alteration | None = None,
) -> None:
    """Fit a network to photos that are rendered during training.

    Parameters
    ----------
    network : nn.Module
        A `training.loop.Trainable`, changed in place.
    draw, held_out : SceneDraws
        Of the photos of training, and of those on which the loss is measured.
    bank : Bank
        On the CPU.
    side : int
        Of the photos, pixels.
    schedule : Schedule
    options : RunOptions
    alter : Alteration, optional
        See `PhotoRenderer`.
    """
    if options.device != "cpu":
        draw = replace(draw, every=_GPU_EVERY)
    made = SceneBatches(draw, bank, side, alter, options.device)
    measured = SceneBatches(held_out, bank, side, alter, options.device)
    fit(network, draw, schedule, options, measured, made.finished)
