"""Fit the network of `isc_core.networks.mask_network`.

  python -m training.masks.mask_network FOLDER ... [--tabletops FOLDER] [--weights NPZ]
  [--minutes N] -o MASK.npz

FOLDER contains the ingredients that `python -m training.masks.ingredients` writes; the cut-outs of
all folders are used. Photos are composed during training (`training.masks.composites`), and none is
used twice. With `--tabletops`, half of the photos are rendered pictures of objects on tables, made
by `python -m training.tabletops`. `--weights` starts from an archive that an earlier
run wrote, `--resume` continues an interrupted one; without either, the encoder starts with the
weights of the shipped scene network. `--side 64` makes photos smaller, which halves the
computation. The loss on held-out objects and panoramas is measured every thousand steps.

Equation: see `training.masks.mask_module`.

Citation: see `training.loop`.

Limits: the confidence is calibrated afterwards, by `training.masks.mask_calibration`.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import torch

from isc_core.cli.interface.values import positive, share
from isc_core.errors import InputError
from isc_core.io.npy import read_arrays
from isc_core.networks.mask_network import SIDE

from ..loop import Schedule, add_run_arguments, fit, photo_side, run_options
from ..tabletops.pictures import read_pictures
from .composites import CompositeDraws, Composites
from .difficulty import DIFFICULT
from .ingredients import SETS
from .mask_module import MaskNetworkModule
from .packs import SUFFIX, Ingredients
from .tabletop_batches import TabletopBatches, WithTabletops

_SHARES = (0.19, 0.53, 0.28)  # of scenes without an object, with one, with several
SCHEDULE = Schedule(rate=2e-3, weight_decay=1e-2, warm_up=200, average_limit=0.998)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("folders", type=Path, nargs="+", metavar="FOLDER", help="ingredients of composites")
    add("--tabletops", type=Path, metavar="FOLDER", help="rendered pictures, half of the photos")
    add("--weights", type=Path, metavar="NPZ", help="start from the weights of an archive")
    add(
        "--side",
        type=photo_side,
        default=SIDE,
        metavar="PX",
        help="of photos (default: %(default)s)",
    )
    add("--rate", type=positive, default=SCHEDULE.rate, help="learning rate (default: %(default)s)")
    add("--hinted", type=share, default=0.5, help="share with hints (default: %(default)s)")
    add_run_arguments(parser, steps=20_000, batch=32)
    arguments = parser.parse_args()
    try:
        _train(arguments)
    except InputError as error:
        parser.error(str(error))


def _train(arguments: argparse.Namespace) -> None:
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    network = MaskNetworkModule()
    training, held_out = (
        Ingredients.read([folder / f"{name}{SUFFIX}" for folder in arguments.folders])
        for name in SETS
    )
    weights = None if arguments.weights is None else read_arrays(arguments.weights)
    network.begin(weights)
    pictures = [] if arguments.tabletops is None else list(read_pictures(arguments.tabletops))
    side, size = arguments.side, options.batch // 2 if pictures else options.batch
    draw = CompositeDraws(size, arguments.hinted, _SHARES, varied=True, difficulty=DIFFICULT)
    compose = Composites(training, draw, side, options.device)
    measured = Composites(held_out, CompositeDraws(options.batch), arguments.side, options.device)
    schedule = replace(SCHEDULE, rate=arguments.rate)
    if pictures:
        rendered = TabletopBatches(pictures, options.batch - size, arguments.hinted, side)
        both = WithTabletops(draw, compose, rendered)
        fit(network, both.draw, schedule, options, measured, both.composed)
    else:
        fit(network, draw, schedule, options, measured, compose.composed)


if __name__ == "__main__":
    main()
