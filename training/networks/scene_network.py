"""Fit the network of `isc_core.networks.scene_network`.

  python -m training.networks.scene_network WORLD... [--panoramas DIR] [--weights NPZ]
  [--device cuda] [--minutes N] -o SCENE.npz

WORLD are folders of `isc world build`, or packs of `isc world pack`. Photos are rendered during
training (`training.world.samples`), and none is used twice. Some opaque bodies get small, sharp
highlights besides those of their recipe (`training.world.small_highlights`), and some white
patterns that look like them. `--weights` starts from an archive that an earlier run wrote,
`--resume` continues an interrupted one; `--side 64` makes photos smaller, which is a quarter of the
work. The loss on held-out bodies under held-out panoramas is measured every thousand steps.

Equation: see `training.networks.scene_module`.

Citation: see `training.loop`.

Limits: uncertainties are calibrated afterwards, by `training.networks.calibration`.
"""

import argparse
from dataclasses import replace
from typing import Any

import torch

from isc_core.cli.interface.values import whole
from isc_core.errors import InputError

from ..loop import Schedule, add_run_arguments, run_options
from ..world.files import Split
from ..world.lit_pictures import LitPictures
from ..world.recipes import Kind, Shares
from ..world.small_highlights import small_highlights
from .scene_batches import SceneDraws, add_photo_arguments, fit_to_photos, read_given
from .scene_module import WIDTHS, SceneNetworkModule

SCHEDULE = Schedule(rate=3e-3, weight_decay=1e-2, warm_up=200, average_limit=0.998)
SHARES = Shares(printed=0.35, white=0.2, stretch=0.2)
_SHARP = 0.35  # share of the opaque bodies that get small highlights
_ABLATIONS: dict[str, dict[str, Any]] = {
    "camera": {},
    "prints": {"printed": 0.0, "white": 0.0},
    "lamps": {"lights": (0.3, 0.7, 0, 0, 0)},
    "harmonics": {"lights": (0, 0.32, 0.3, 0.14, 0.24)},
    "gloss": {"matte": 1.0, "kinds": (1, 0, 0)},
    "stretch": {"stretch": 0.0},
}


def with_small_highlights(pictures: LitPictures) -> LitPictures:
    """Add small, sharp highlights to some of the opaque bodies.

    Parameters
    ----------
    pictures : LitPictures

    Returns
    -------
    LitPictures
    """
    diffuse, specular = pictures.layers[:, :6].float().split(3, 1)
    sharp = torch.rand(len(diffuse), device=diffuse.device) < _SHARP
    sharp &= pictures.kind == Kind.OPAQUE
    specular = specular + small_highlights(pictures) * sharp[:, None, None, None]
    return pictures.with_light(diffuse, specular)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_photo_arguments(parser, SCHEDULE.rate)
    add = parser.add_argument
    add("--widths", type=whole, nargs="+", default=WIDTHS, metavar="N", help="channels by level")
    add("--without", nargs="+", default=[], choices=sorted(_ABLATIONS), help="leave out, to ablate")
    add_run_arguments(parser, steps=100_000, batch=32)
    arguments = parser.parse_args()
    try:
        _train(arguments)
    except InputError as error:
        parser.error(str(error))


def _train(arguments: argparse.Namespace) -> None:
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    world, start = read_given(arguments, options.seed)
    widths = tuple(arguments.widths)
    network = SceneNetworkModule(widths) if start is None else SceneNetworkModule.of(start)
    schedule = replace(SCHEDULE, rate=arguments.rate)
    shares = SHARES
    for name in arguments.without:
        shares = replace(shares, **_ABLATIONS[name])
    draw = SceneDraws(
        world.views[Split.TRAIN],
        world.atlas,
        world.training_environments,
        options.batch,
        shares,
        "camera" in arguments.without,
    )
    held_out = replace(
        draw, views=world.views[Split.UNSEEN_BODY], environments=world.held_out_environments
    )
    glossy = "gloss" not in arguments.without
    alter = with_small_highlights if glossy else None
    fit_to_photos(network, draw, held_out, world.bank, arguments.side, schedule, options, alter)


if __name__ == "__main__":
    main()
