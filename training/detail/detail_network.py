"""Fit the network of `isc_core.networks.detail_network`.

  python -m training.detail.detail_network [--minutes N] -o DETAIL.npz

Patches of surfaces are drawn, lit and photographed while the network learns
(`training.detail.patches`); reliefs and patterns are drawn first, in a minute or two. It needs no
data. Other reliefs and patterns are measured every thousand steps. `--resume` continues an
interrupted run.

Equation: see `training.detail.detail_module`.

Citation: see `training.loop`.

Limits: none of its own.
"""

import argparse
from dataclasses import replace

import torch

from ..loop import Schedule, add_run_arguments, fit, run_options
from .detail_module import DetailNetworkModule
from .patches import Patches

SIDE = 96
SCHEDULE = Schedule(rate=3e-3, weight_decay=1e-2, warm_up=100, average_limit=0.998)
_HELD_OUT = 1000  # of the seeds


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--side", type=int, default=SIDE, metavar="PX", help="of patches (default: %(default)s)")
    add("--rate", type=float, default=SCHEDULE.rate, help="learning rate (default: %(default)s)")
    add("--reliefs", type=int, default=240, metavar="N", help="to draw (default: %(default)s)")
    add_run_arguments(parser, steps=6000, batch=16)
    arguments = parser.parse_args()
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    side, count = arguments.side, arguments.reliefs
    fit(
        DetailNetworkModule(),
        Patches(options.seed, options.batch, side, count, uses=4),
        replace(SCHEDULE, rate=arguments.rate),
        options,
        Patches(options.seed + _HELD_OUT, options.batch, side, max(count // 5, 1)),
    )


if __name__ == "__main__":
    main()
