"""`isc edit`: changes light, gloss or colour of a decomposed photo; one file per action."""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from ....editing.edit_folder import Original, Record, Sheet, require_writable_edit, save_edit
from ....errors import InputError
from ....imaging.srgb import linear_to_srgb
from ....photo import read_raster
from ....progress import Monitor
from ....result_files.result_folder import load_part
from ....scene.decomposition import Decomposition
from ...interface.options import limits_of
from ...interface.parser import GENERAL, describe, hints
from ...interface.result_photo import photo_of_result
from . import dichromatic, gloss, highlight, light_direction, recolour, relight
from .action import ActionResult, EditAction
from .options import add_common, plain

_EXAMPLES = """  isc edit cup light-direction -o light      the light's direction and uncertainty
  isc edit cup highlight --direction -0.5 0.6 0.6 -o glint      a new highlight
  isc edit cup gloss --look metallic -o metal
  isc edit cup dichromatic --remove specular --photo cup.png -o diffuse      in the photo itself
  isc edit cup recolour --cluster 2 --colour 2060c0 -o blue      clusters.png shows the clusters
  isc edit cup relight --yaw 60 -o turned

Every action takes --photo, --mask, --transfer and -o.
`isc edit RESULT ACTION --help` shows its other options."""


_NOT_PARAMETERS = ("run", "act", "output", "action", "usual", "max_pixels", *GENERAL)


ACTIONS: tuple[EditAction, ...] = (
    light_direction.ACTION,
    highlight.ACTION,
    gloss.ACTION,
    dichromatic.ACTION,
    recolour.ACTION,
    relight.ACTION,
)


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
        "Edit a result of isc decompose. Writes a folder with the image (edited.png, "
        "edited.exr), before_after.png (start here) and edit.json. With --photo, the edit "
        "is applied to the photo, at its size and in its encoding.",
        examples=_EXAMPLES,
    )
    parser.add_argument(
        "result", type=Path, metavar="RESULT", help="a folder written by isc decompose"
    )
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True, dest="action")
    for action in ACTIONS:
        added = actions.add_parser(
            action.name,
            help=action.summary,
            description=f"{action.summary[0].upper()}{action.summary[1:]}.",
        )
        added.set_defaults(act=action.act)
        action.add_options(added)
        add_common(added)


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Edit a result; problems are found before anything is written.

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
        If the result, the photo or an option cannot be used.
    """
    read = (getattr(options, name, None) for name in ("photo", "mask", "region", "light"))
    require_writable_edit(options.output, read)
    if options.photo is None and (options.mask is not None or options.transfer is not None):
        raise InputError("--mask and --transfer require --photo: add it")
    monitor.report("reading", 0.0)
    stored = load_part(options.result)
    d = stored.result
    _check_result(d, options.result)
    monitor.report("editing", 0.2)
    done = options.act(stored, options)
    original = None if options.photo is None else _original(d, options)
    notes = [*done.edit.notes, *_notes(d, done, original)]
    monitor.report("writing", 0.7)
    parameters = {
        name: plain(value) for name, value in vars(options).items() if name not in _NOT_PARAMETERS
    }
    name = Path(str(d.provenance.input.get("name", ""))).name or options.result.name
    sheet = Sheet(f"{name}: {options.action}", _changed_options(options), done.panels, done.layers)
    record = Record(options.action, parameters, done.measured)
    edit = replace(done.edit, notes=tuple(notes))
    save_edit(
        stored, edit, options.output, record, sheet, original=original, clusters=done.clusters
    )  # fmt: skip
    monitor.report("writing", 1.0)
    return [
        *done.lines,
        *hints(
            options,
            *(f"note: {note}" for note in notes),
            f"see {options.output / 'before_after.png'}",
        ),
    ]


def _check_result(d: Decomposition, folder: Path) -> None:
    """Raise `InputError` for a result that violates the identities, which may cause divisions by
    zero.
    """
    broken = list(d.identity_errors().broken())
    broken += [
        f"{name} >= 0"
        for name in ("image", "diffuse", "specular", "reflectance", "shading")
        if getattr(d, name)[d.mask].min() < 0
    ]
    if broken:
        raise InputError(f"{folder} violates {broken[0]}: it is damaged; decompose the photo again")


def _notes(d: Decomposition, done: ActionResult, original: Original | None) -> list[str]:
    """Notes beyond those of the edit itself."""
    notes = []
    if original is not None and d.provenance.input.get("sha256") != original.photo.original.sha256:
        notes.append(
            "the photo's file differs from the one that was decomposed; the edit is applied anyway"
        )
    if done.layers and np.array_equal(done.edit.image, d.image):
        notes.append("the image is unchanged: none of the options affects it")
    return notes


def _changed_options(options: argparse.Namespace) -> str:
    """The options that differ from their defaults, for the sheet."""
    skip = (*_NOT_PARAMETERS, "result", "photo", "mask", "transfer")
    parts = []
    for name, value in vars(options).items():
        if (
            name in skip
            or value is None
            or value is False
            or np.array_equal(value, options.usual.get(name))
        ):
            continue
        text = value
        if isinstance(value, np.ndarray):
            text = "".join(
                f"{code:02x}" for code in np.rint(255 * linear_to_srgb(value)).astype(int)
            )
        elif isinstance(value, list):
            text = " ".join(f"{n:g}" for n in value)
        parts.append(
            name.replace("_", "-") if value is True else f"{name.replace('_', '-')} {text}"
        )
    return "   ·   ".join(map(str, parts))


def _original(d: Decomposition, options: argparse.Namespace) -> Original:
    limits = limits_of(options)
    photo = photo_of_result(
        d, options.result, options.photo, options.mask, options.transfer, limits
    )
    raster = read_raster(options.photo, limits)
    if raster.sha256 != photo.original.sha256:
        raise InputError(f"{options.photo} changed while it was read: run the command again")
    return Original(photo, raster, options.photo)
