"""Fit the network of `isc_core.networks.scene_network`.

  python -m training.networks.scene_network WORLD... --panoramas DIR [--weights NPZ]
  [--device cuda] [--minutes N] -o SCENE.npz

WORLD are folders of `isc world build`. Every photo is lit anew (`training.world.samples`), so none
is seen twice. `--weights` starts from an archive that an earlier run wrote, `--resume` continues an
interrupted one. Held-out bodies under held-out panoramas are measured every thousand steps.

Equation: see `training.networks.scene_module`.

Citation: see `training.loop`.

Limits: uncertainties are calibrated afterwards, by `training.networks.calibration`.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from isc_core.io.npy import read_arrays

from ..loop import Schedule, add_run_arguments, fit, run_options
from ..world.files import Split
from ..world.recipes import Shares
from ..world.samples import finish_batch
from .scene_batches import SceneBatches, read_world
from .scene_module import WIDTHS, SceneNetworkModule

SCHEDULE = Schedule(
    rate=1.5e-3, head_rate=1e-3, weight_decay=1e-2, warm_up=200, average_limit=0.998
)
_ABLATIONS: dict[str, dict[str, Any]] = {
    "camera": {},
    "prints": {"printed": 0.0},
    "lamps": {"lights": (0.3, 0.7, 0, 0, 0)},
    "harmonics": {"lights": (0, 0.32, 0.3, 0.14, 0.24)},
    "gloss": {"matte": 1.0, "kinds": (1, 0, 0)},
}


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
    if arguments.weights is None:
        network = SceneNetworkModule(tuple(arguments.widths))
    else:
        network = SceneNetworkModule.of(dict(read_arrays(arguments.weights)))
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
