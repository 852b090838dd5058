"""`isc separate`: a photo's diffuse and specular layers, without shape and light."""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.limits import Limits
from ...photo import Photo, read_linear, read_photo
from ...progress import Monitor
from ...result_files.result_folder import require_writable_result, save_separation
from ...scene.decomposition import Separation
from ...separation import BEST, IMPROVED, METHODS, separate
from ...separation.option_text import parse_changes
from ...separation.support.checks import has_colour
from ..interface.options import Commands, add_command, add_photo, hints, limits_of

_EXAMPLES = """  isc separate cup.png -o cup-layers
  isc separate highlights.bmp --transfer linear --method shen_2013 --variant paper -o layers
  isc separate cup.png --method shen_2013 --set ratio_quantile=0.4 -o cup-layers"""


def declare(commands: Commands) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : object
        Returned by `add_subparsers`.
    """
    parser = add_command(
        commands,
        "separate",
        run,
        "diffuse and specular light only",
        "Splits a photo into diffuse and specular light. Writes a folder with separation.exr and "
        "images of both. A photo without mask, "
        "transparency and black border is processed as a whole.",
        _EXAMPLES,
    )
    add_photo(parser)
    parser.add_argument(
        "--method",
        choices=METHODS,
        default=BEST,
        metavar="NAME",
        help=f"separation method: {', '.join(METHODS)} (default {BEST})",
    )
    parser.add_argument(
        "--variant",
        default=IMPROVED,
        metavar="NAME",
        help="improved (default), paper (as published) or, for some methods, sihr (as in the "
        "public toolbox SIHR)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="changes",
        metavar="NAME=VALUE",
        help="change an option of the method; can be repeated; an unknown NAME lists all options",
    )
    parser.add_argument(
        "--prior",
        type=Path,
        metavar="FILE",
        help=f"for {BEST}: a grey image of the photo's size, the probability of a highlight: "
        "black never, middle grey (0.5) unknown",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DIR",
        help="the folder to write; an earlier result is replaced",
    )


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command; inputs are checked before the work begins.

    Parameters
    ----------
    options : argparse.Namespace
    monitor : Monitor

    Returns
    -------
    list of str
        Lines to print.

    Raises
    ------
    InputError
        If --prior is given for a method other than `BEST`.
    """
    changes = parse_changes(options.method, options.variant, options.changes)
    if options.prior is not None and options.method != BEST:
        raise InputError(f"--prior needs the method {BEST}")
    require_writable_result(
        options.output, separation=True, inputs=(options.photo, options.mask, options.prior)
    )
    photo = read_photo(
        options.photo, options.mask, options.transfer, whole_frame=True, limits=limits_of(options)
    )
    prior = (
        None
        if options.prior is None
        else _read_prior(options.prior, photo.mask.shape, limits_of(options))
    )
    monitor.report(f"separating ({options.method})", 0.1)
    layers = separate(
        options.method, photo.image, photo.mask, photo.clipped,
        variant=options.variant, changes=changes, prior=prior, monitor=monitor.part(0.1, 0.8),
    )  # fmt: skip
    monitor.report("writing", 0.8)
    save_separation(layers, photo.image, options.output, mask=photo.mask, title=options.photo.name)
    for note in [] if options.quiet else _notes(options, photo, layers):
        print(f"isc: note: {note}", file=sys.stderr)
    return hints(options, f"see {options.output / 'preview.png'}")


def _notes(options: argparse.Namespace, photo: Photo, layers: Separation) -> Iterator[str]:
    """Notes on the result."""
    if photo.original.mask_from == "whole frame":
        yield "no mask: the whole image was processed; set one with --mask"
    if options.method == "none" or layers.specular[~photo.clipped].any():
        return
    if has_colour(photo.image, photo.mask):
        yield "no highlight was detected with confidence, so the photo was left unchanged"
    else:
        yield (
            "the photo has no colour, which distinguishes highlights from reflectance, so it was "
            "left unchanged: use a colour photo"
        )


def _read_prior(path: Path, size: tuple[int, ...], limits: Limits) -> np.ndarray:
    """The stored values of an image, as probabilities (H, W) in [0, 1].

    Raise `InputError` unless it has the photo's size (H, W).
    """
    prior: np.ndarray = np.clip(read_linear(path, "linear", limits).mean(axis=2), 0, 1)
    if prior.shape != size:
        raise InputError(f"{path}: the prior must have the photo's size {size}, not {prior.shape}")
    return prior
