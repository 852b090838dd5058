"""`isc refine`: the gloss of a result, and its light, refined by rendering."""

import argparse
import hashlib
import os
from pathlib import Path

from isc_core.cli.interface.parser import describe, hints
from isc_core.cli.interface.values import count
from isc_core.errors import InputError
from isc_core.io.stage_cache import KeptStages
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.part_of_result import ResultPart

_EXAMPLES = """  isc refine cup -o cup_refined
  isc refine cup --photo cup.jpg -o cup_refined
  isc refine cup --light -o cup_refined                  shadows too, needs Mitsuba"""


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
        "Fit lamps, roughness, strength and a bounded change of the shape to the separated "
        "highlights, so that rendered highlights appear where the photo shows them. The image and "
        "its layers do not change; gloss, shape, light and reflectance change only if the fit "
        "explains held-out pixels better. After an interruption, the same command continues.",
        examples=_EXAMPLES,
    )
    parser.add_argument(
        "result", type=Path, metavar="RESULT", help="a folder written by isc decompose"
    )
    parser.add_argument(
        "--photo", type=Path, metavar="PHOTO", help="check that RESULT is of this photo"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="output folder"
    )
    parser.add_argument(
        "--light",
        action="store_true",
        help="then fit an environment map, with the shadows that the shape casts traced by Mitsuba "
        "(experimental)",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=0,
        metavar="S",
        help="seed of the held-out pixels (default: 0)",
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
        If the result or the photo cannot be used, or the output cannot be written.
    Cancelled
        If the user cancels.
    """
    from isc_core.io.checkpoint import Checkpoint
    from isc_core.result_files.mesh.object_cover import read_cover
    from isc_core.result_files.result_folder import (
        MASK,
        load_part,
        require_writable_result,
        save,
    )

    if options.light:
        from ..scene.variant import load_mitsuba

        load_mitsuba()
    if os.path.realpath(options.output) == os.path.realpath(options.result):
        raise InputError("the refined result cannot replace its input: choose another folder")
    require_writable_result(options.output, inputs=(options.photo,))
    stored = load_part(options.result)
    if options.light:
        from ..refine.refine import require_refinable

        require_refinable(stored.result)
    if options.photo is not None:
        _require_same(options.photo, stored.result)
    with Checkpoint(options.output) as checkpoint:
        result, lines = _refined(stored, options, checkpoint, monitor.part(0, 0.9))
        cover = read_cover(options.result / MASK, stored.result.provenance.input)
        writing = monitor.part(0.9, 1.0)
        save(result, options.output, cover=cover, part=stored.part, monitor=writing)
        checkpoint.remove()
    return [*lines, *hints(options, *checkpoint.notes(), f"wrote {options.output}")]


def _refined(
    stored: ResultPart, options: argparse.Namespace, kept: KeptStages, monitor: Monitor
) -> tuple[Decomposition, list[str]]:
    """The refined result, and lines about the gloss and the light."""
    from isc_core.refinement import GlossOptions, refine_gloss
    from isc_core.refinement.gloss_note import gloss_line

    end = 0.55 if options.light else 1.0
    how = GlossOptions(seed=options.seed)
    result = refine_gloss(stored.result, how, monitor.part(0, end), kept).result
    lines = [gloss_line(result.provenance.settings)]
    if options.light:
        from ..refine.refine import RefineOptions, refine

        fitting = monitor.part(end, 1.0)
        done = refine(result, RefineOptions(seed=options.seed), fitting, stored.part, kept)
        result = done.result
        lines.append(
            f"the light was refined: objective {done.before:.3f} -> {done.after:.3f}"
            if done.kept
            else f"the light was not refined: {_reason(done.before, done.after)}"
        )
    return result, lines


def _reason(before: float, after: float) -> str:
    if after < before:
        return "held-out pixels are not explained better"
    return f"the objective did not fall ({before:.3f} -> {after:.3f})"


def _require_same(photo: Path, start: Decomposition) -> None:
    recorded = str(start.provenance.input.get("sha256", ""))
    try:
        found = hashlib.sha256(photo.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"cannot read the photo {photo}: {error.strerror}") from error
    if not recorded:
        raise InputError("the result has no checksum of its photo: leave out --photo")
    if found != recorded:
        raise InputError(f"the result is not of {photo} (another checksum): give its own photo")
