"""Fit the network of `isc_core.networks.highlight_network`.

  python -m training.networks.highlight_network WORLD... [--panoramas DIR] [--weights NPZ]
  [--minutes N] -o HIGHLIGHT.npz

WORLD are folders of `isc world build`, or packs of `isc world pack`. Photos are rendered during
training: of opaque bodies, most of them with print, often white on a strong colour. For each photo
the specular light is that of the recipe times a random factor, or absent; colour channels are
exchanged. The fit starts from the scene network's levels down, or with `--weights` from an archive
that an earlier run wrote; `--resume` continues an interrupted one, `--side 96` makes photos
smaller. The loss on held-out bodies under held-out panoramas is measured every thousand steps.

Equation: see `training.networks.highlight_module`.

Citation: see `training.loop`.

Limits: print lies on bodies as `training.world.recipes` puts it.
"""

import argparse
from dataclasses import replace

import torch

from isc_core.errors import InputError

from ..loop import Schedule, add_run_arguments, run_options
from ..world.files import Split
from ..world.lit_pictures import LitPictures
from ..world.recipes import Shares
from ..world.small_highlights import small_highlights
from .highlight_module import HighlightNetworkModule
from .scene_batches import SceneDraws, add_photo_arguments, fit_to_photos, read_given

SCHEDULE = Schedule(rate=1.5e-3, weight_decay=1e-2, average_limit=0.995)
SHARES = Shares(
    kinds=(1, 0, 0),
    paints=(0.2, 0.15, 0.1, 0.1, 0.3, 0.15),
    lights=(0.06, 0.3, 0.34, 0.15, 0.15),
    printed=0.5,
    matte=0.0,
    coated=0.1,
    white=0.45,
    stretch=0.2,
)
_PHOTOS = 8  # of each lit view: their gloss and colours differ, too
_MATT = 0.35  # share of photos without gloss
_GAIN = (0.3, 0.6)  # mean and deviation of the factor's logarithm
_SHARP = 0.6  # share of the others that have small highlights, too


def varied(pictures: LitPictures) -> LitPictures:
    """Return pictures with other strengths of specular light and other orders of channels.

    Parameters
    ----------
    pictures : LitPictures

    Returns
    -------
    LitPictures
    """
    layers = pictures.layers.float()
    count = len(layers)
    device = layers.device
    gain = torch.exp(_GAIN[0] + _GAIN[1] * torch.randn(count, device=device))
    gain = torch.where(torch.rand(count, device=device) < _MATT, 0.0, gain)
    order = torch.rand(count, 3, device=device).argsort(1)
    order = order[..., None, None].expand(-1, -1, *layers.shape[2:])
    diffuse, gloss = layers[:, :3], layers[:, 3:6]
    sharp = (gain > 0) & (torch.rand(count, device=device) < _SHARP)
    gain = torch.where(sharp, gain * torch.rand(count, device=device), gain)
    gloss = gloss.gather(1, order) * gain[:, None, None, None]
    gloss = gloss + small_highlights(pictures) * sharp[:, None, None, None]
    return pictures.with_light(diffuse.gather(1, order), gloss)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_photo_arguments(parser, SCHEDULE.rate)
    add_run_arguments(parser, steps=20_000, batch=32)
    arguments = parser.parse_args()
    try:
        _train(arguments)
    except InputError as error:
        parser.error(str(error))


def _train(arguments: argparse.Namespace) -> None:
    options = run_options(arguments)
    torch.manual_seed(options.seed)
    network = HighlightNetworkModule()
    world, start = read_given(arguments, options.seed)
    network.begin(start)
    draw = SceneDraws(
        world.views[Split.TRAIN],
        world.atlas,
        world.training_environments,
        options.batch,
        SHARES,
        photos=_PHOTOS,
    )
    held_out = replace(
        draw, views=world.views[Split.UNSEEN_BODY], environments=world.held_out_environments
    )
    schedule = replace(SCHEDULE, rate=arguments.rate)
    fit_to_photos(network, draw, held_out, world.bank, arguments.side, schedule, options, varied)


if __name__ == "__main__":
    main()
