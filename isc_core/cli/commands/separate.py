"""`isc separate`: a photo's diffuse and specular layers, without shape and light."""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.limits import Limits
from ...masking.finder import MaskSearch
from ...photo import Photo, WholeFrame, read_linear, read_photo
from ...progress import Monitor
from ...result_files.reading_notes_text import reading_note_lines
from ...result_files.result_folder import require_writable_result, save_separation
from ...scene.decomposition import Separation
from ...scene.diagnostics import Abstention
from ...separation import BEST, IMPROVED, METHODS, separate
from ...separation.option_text import parse_changes
from ..interface.mask_options import add_hints, hints_of, how_found
from ..interface.options import (
    add_limits,
    add_mask,
    add_open,
    add_output,
    add_photo,
    add_transfer,
    limits_of,
    methods_table,
)
from ..interface.parser import describe, hints
from ..interface.standard_input import photo_file
from ..interface.viewer import show

_EXAMPLES = """  isc separate cup.png -o cup-layers
  isc separate highlights.bmp --transfer linear --method shen_2013 --variant paper -o layers
  isc separate cup.png --method shen_2013 --set ratio_quantile=0.4 -o cup-layers"""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    describe(
        parser,
        run,
        "Split a photo into diffuse and specular light. Writes a folder with separation.exr and "
        "images of both. A photo without a mask, transparency, a black border or one distinct "
        "object is processed as a whole.",
        examples=_EXAMPLES,
        more=methods_table(),
    )
    add_photo(parser)
    main = parser.add_argument_group("main options")
    add_output(main)
    add_mask(main)
    add_hints(main)
    main.add_argument(
        "--whole",
        action="store_true",
        help="process the whole photo, without a search for an object, with its transparent pixels "
        "and its black border",
    )
    main.add_argument(
        "--method",
        choices=METHODS,
        default=BEST,
        metavar="NAME",
        help=f"separation method, see below (default {BEST})",
    )
    add_open(main)
    _add_method_options(parser.add_argument_group("method"))
    reading = parser.add_argument_group("reading the photo")
    add_transfer(reading)
    add_limits(reading)


def _add_method_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--variant",
        default=IMPROVED,
        metavar="NAME",
        help="improved (default), paper (as published) or, for some methods, sihr (as in the "
        "public toolbox SIHR)",
    )
    group.add_argument(
        "--set",
        action="append",
        default=[],
        dest="changes",
        metavar="NAME=VALUE",
        help="change an option of the method; can be repeated; an unknown NAME lists all options",
    )
    group.add_argument(
        "--prior",
        type=Path,
        metavar="FILE",
        help=f"for {BEST}: a grey image of the photo's size with the probability of a highlight; "
        "black is 0, middle grey (0.5) is unknown",
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
        If --whole is given with a selection of the object, or --prior for a method other than
        `BEST`.
    """
    given = hints_of(options)
    if options.whole and (given or options.mask is not None):
        raise InputError(
            "--whole processes the whole photo: leave out --mask, --box, --point and --not"
        )
    changes = parse_changes(options.method, options.variant, options.changes)
    if options.prior is not None and options.method != BEST:
        raise InputError(f"--prior requires --method {BEST}: use it, or leave --prior out")
    require_writable_result(
        options.output, separation=True, inputs=(options.photo, options.mask, options.prior)
    )
    limits = limits_of(options)
    with photo_file(options.photo, options) as file:
        photo = read_photo(
            file,
            options.mask,
            options.transfer,
            whole_frame=WholeFrame.ALWAYS if options.whole else WholeFrame.WITHOUT_MASK,
            limits=limits,
            finder=MaskSearch(given, lenient=True),
        )
    prior = None if options.prior is None else _read_prior(options.prior, photo.mask.shape, limits)
    monitor.report(f"separating ({options.method})", 0.1)
    layers = separate(
        options.method, photo.image, photo.mask, photo.clipped,
        variant=options.variant, changes=changes, prior=prior, monitor=monitor.part(0.1, 0.8),
    )  # fmt: skip
    monitor.report("writing", 0.8)
    cover = None if photo.found is None else photo.found.cover
    title = options.photo.name
    save_separation(layers, photo.image, options.output, mask=photo.mask, title=title, cover=cover)
    preview = options.output / "preview.png"
    return hints(
        options,
        *reading_note_lines(photo.original.notes),
        *(f"note: {note}" for note in _notes(options, photo, layers)),
        *(show(preview) if options.open else ()),
        f"see {preview}",
    )


def _notes(options: argparse.Namespace, photo: Photo, layers: Separation) -> Iterator[str]:
    """Notes on the result."""
    if found := how_found(photo):
        yield f"{found}, see mask.png in the result; --whole processes the whole photo"
    if photo.original.mask_from == "whole frame":
        yield "no mask: the whole image was processed; set one with --mask"
    if options.method != "none" and not layers.specular[~photo.clipped].any():
        yield f"no highlight was found: {_why_unchanged(options.method, layers)}"


def _why_unchanged(method: str, layers: Separation) -> str:
    if method == "network":
        return "none stands out to the network; --set stands_out=0 removes what it finds"
    if layers.abstention is None:
        return f"the equation of {method} attributes no pixel to one; try --method {BEST}"
    reasons = {
        Abstention.NO_COLOUR: (
            "the photo has no colour, which distinguishes highlights from reflectance; use a "
            "colour photo"
        ),
        Abstention.NO_CANDIDATE: "no pixel is paler than the others of its hue",
        Abstention.NEAR_GREY: (
            "the bright pixels are nearly grey, so highlights have the same colour; "
            "isc decompose --model joint also uses the shape"
        ),
        Abstention.NOT_PROVEN: (
            "the pale areas look like paint: their edges are sharp, or they follow the object's "
            "colours; mark highlights by hand with --prior"
        ),
        Abstention.PRINT: (
            "the pale areas are likelier print than highlights; --set odds=0 removes them, or mark "
            "highlights by hand with --prior"
        ),
    }
    return reasons[layers.abstention]


def _read_prior(path: Path, size: tuple[int, ...], limits: Limits) -> np.ndarray:
    """The stored values of an image, as probabilities (H, W) in [0, 1].

    Raise `InputError` unless it has the photo's size (H, W).
    """
    prior: np.ndarray = np.clip(read_linear(path, "linear", limits).mean(axis=2), 0, 1)
    if prior.shape != size:
        (height, width), (h, w) = size, prior.shape
        raise InputError(
            f"{path}: the prior is {w} x {h} pixels, the photo {width} x {height}: use a prior of "
            "the photo's size"
        )
    return prior
