"""`isc validate`: the errors of every stage on rendered scenes, their causes, and whether they meet
the bounds.
"""

import argparse
import os
import shlex
from pathlib import Path

from isc_core.cli.interface.parser import describe, hints
from isc_core.cli.interface.values import count, location, names
from isc_core.decomposition.pipeline import ILLUMINATIONS
from isc_core.decomposition.settings import SEPARATING_MODELS
from isc_core.errors import InputError, Rejected
from isc_core.io.atomic import require_writable_file
from isc_core.progress import Monitor
from isc_core.separation import BEST, METHODS

_EXAMPLES = """  isc synth --count 60 --size 128 -o scenes
  isc validate scenes -o validation
  isc validate scenes -o models --stages separation --models mdr,mbp,joint
  isc validate scenes -o shen --separator shen_2013 --bounds none
  isc validate scenes -o validation --update-bounds bounds.json"""
_NO_BOUNDS = "none"
_RENDERS = 3


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
        "Run the stages on a data set of isc synth. The report (report.html, report.json, "
        "summary.md) has errors with confidence intervals, an error budget by substituting the "
        "ground truth for one stage at a time, slices by gloss, light, albedo, material and size, "
        "pictures, and a comparison of models. The exit code is 1 if a bound is violated; the "
        "maps of the worst scenes are then in the folder evidence.",
        examples=_EXAMPLES,
    )
    parser.add_argument("dataset", metavar="DATASET", type=Path, help="output folder of isc synth")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DIR",
        help="output folder; an earlier report is replaced",
    )
    _add_scenes(parser)
    _add_stages(parser)
    _add_checks(parser)


def _add_scenes(parser: argparse.ArgumentParser) -> None:
    scenes = parser.add_argument_group("scenes")
    scenes.add_argument("--split", metavar="NAME", help="split to run (default: all)")
    scenes.add_argument(
        "--scenes",
        type=count,
        default=0,
        metavar="N",
        help="number of scenes, drawn by --seed (default: all)",
    )
    scenes.add_argument(
        "--seed", type=count, default=0, metavar="S", help="seed of all random draws (default: 0)"
    )
    scenes.add_argument(
        "--threads",
        type=count,
        default=0,
        metavar="N",
        help="number of scenes in parallel; 0 for one per core (default: 0)",
    )


def _add_stages(parser: argparse.ArgumentParser) -> None:
    stages = parser.add_argument_group("stages")
    known = (
        "separation, sirfs, gloss (default: these, and the chain with its error budget), refine "
        "(the gloss of isc refine over that of isc decompose)"
    )
    stages.add_argument("--stages", type=names, metavar="a,b", help=known)
    models = f"models to compare with plain SIRFS: {', '.join(SEPARATING_MODELS)} (default: none)"
    stages.add_argument("--models", type=names, metavar="a,b", help=models)
    stages.add_argument(
        "--separator",
        choices=METHODS,
        default=BEST,
        metavar="NAME",
        help="separation method (default: %(default)s)",
    )
    stages.add_argument(
        "--illumination",
        choices=ILLUMINATIONS,
        default=ILLUMINATIONS[0],
        help="light prior of SIRFS (default: %(default)s)",
    )


def _add_checks(parser: argparse.ArgumentParser) -> None:
    checks = parser.add_argument_group("bounds and checks")
    checks.add_argument(
        "--bounds",
        type=location(_NO_BOUNDS),
        metavar="FILE",
        help="regression bounds; none to skip them (default: those of the package)",
    )
    checks.add_argument(
        "--update-bounds",
        type=Path,
        metavar="FILE",
        help="write bounds that this run meets, with a margin",
    )
    checks.add_argument(
        "--renders",
        type=count,
        default=_RENDERS,
        metavar="N",
        help="number of scenes to render again as a check (default: %(default)s)",
    )


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed options.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    list of str
        Lines for the user.

    Raises
    ------
    Rejected
        If a bound is violated; the report is written.
    InputError
        For invalid input, before the work begins.
    """
    from ..validation.measurement.bounds import SHIPPED, bounds_from, read_bounds, write_bounds
    from ..validation.measurement.measure import ValidationOptions
    from ..validation.reporting.folder import require_writable_report, write_report
    from ..validation.stages.models import models_stage
    from ..validation.stages.registry import find_stages
    from ..validation.stages.types import StageOptions
    from ..validation.validate import validate

    models = tuple(dict.fromkeys(options.models or ()))
    settings = StageOptions(options.separator, options.illumination, models=models)
    stages = find_stages(options.stages) + ((models_stage(models),) if models else ())
    wanted = ValidationOptions(
        options.split, options.scenes, stages, settings, options.seed, options.threads
    )
    bounds_file = SHIPPED if options.bounds is None else Path(options.bounds)
    bounds = (
        ()
        if options.bounds == _NO_BOUNDS or (options.bounds is None and not SHIPPED.is_file())
        else read_bounds(bounds_file)
    )
    require_writable_report(options.output)
    if options.update_bounds is not None:
        require_writable_file(options.update_bounds)
    if os.path.realpath(options.output) == os.path.realpath(options.dataset):
        raise InputError("the report cannot replace the data set: choose another folder for -o")
    outcome = validate(
        options.dataset, wanted, bounds, options.renders, _command(options), monitor.part(0, 0.9)
    )
    write_report(outcome, options.output, monitor.part(0.9, 1))
    if options.update_bounds is not None:
        write_bounds(options.update_bounds, bounds_from(outcome.figures))
    if outcome.failures:
        raise Rejected("\n".join([*outcome.failures, f"report: {options.output / 'report.html'}"]))
    return [*outcome.notes, *hints(options, f"report: {options.output / 'report.html'}")]


def _command(options: argparse.Namespace) -> str:
    """The command that repeats the run."""
    words = ["isc", "validate", str(options.dataset), "-o", str(options.output)]
    for name, default in (
        ("split", None),
        ("scenes", 0),
        ("separator", BEST),
        ("illumination", ILLUMINATIONS[0]),
        ("bounds", None),
        ("renders", _RENDERS),
    ):
        if (value := getattr(options, name)) != default:
            words += [f"--{name}", str(value)]
    for name in ("stages", "models"):
        if getattr(options, name):
            words += [f"--{name}", ",".join(getattr(options, name))]
    return shlex.join([*words, "--seed", str(options.seed)])
