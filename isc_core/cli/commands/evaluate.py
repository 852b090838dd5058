"""`isc evaluate`: errors of a model against ground truth, object by object."""

import argparse
import json
from pathlib import Path

from ...datasets.mit_berkeley import ILLUMINATIONS, INPUTS
from ...decomposition.settings import LIGHT_PRIORS, SHAPE_PRIORS, LightPrior, ShapePrior
from ...evaluation.evaluate import evaluate
from ...evaluation.runner import Protocol, RunnerOptions, make_runner
from ...io.atomic import new_file, require_writable_file
from ...progress import Monitor
from ...sirfs.priors.prior_file import load_prior_set, shipped_prior_set
from ..interface.options import add_engine
from ..interface.parser import describe
from ..interface.values import current_name, names

_EXAMPLES = """  isc evaluate DATA --dataset mit-berkeley --json scores.json
  isc evaluate DATA --dataset mit-berkeley --objects apple,cup1 --illumination natural
  isc evaluate DATA --dataset mit-berkeley --input original --model joint

The priors of the package were fitted to the training objects of this set. For an unbiased figure
leave the object out:
  isc fit-priors DATA --leave-out apple -o priors.npz
  isc evaluate DATA --dataset mit-berkeley --objects apple --priors priors.npz"""

_PRIOR = "as for isc decompose (default for --protocol reference: {}, which measures SIRFS alone)"


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
        "Print the errors of height, normals, shading, reflectance and light for each object, "
        "and their geometric means.",
        examples=_EXAMPLES,
    )
    parser.add_argument("root", metavar="ROOT", type=Path, help="the folder of the data set")
    main = parser.add_argument_group("main options")
    main.add_argument(
        "--dataset", choices=("mit-berkeley",), required=True, help="format of the data set"
    )
    main.add_argument(
        "--objects", type=names, metavar="a,b", help="names of the objects (default: all)"
    )
    main.add_argument(
        "--input",
        choices=INPUTS,
        default="diffuse",
        help="images without highlights, or as photographed (default %(default)s)",
    )
    main.add_argument(
        "--illumination",
        choices=(*ILLUMINATIONS, "both"),
        help="light of the images (default: both, or laboratory for --input original; for a set of "
        "isc synth glossy-mit its own)",
    )
    main.add_argument(
        "--model",
        metavar="NAME",
        help="as for isc decompose (default: sirfs, or joint for --input original)",
    )
    main.add_argument(
        "--protocol",
        choices=tuple(protocol.value for protocol in Protocol),
        default=Protocol.REFERENCE.value,
        help="reference: the published protocol, at the images' own scale on the data set's crop; "
        "users: the defaults of isc decompose (default %(default)s)",
    )
    main.add_argument(
        "--json", type=Path, metavar="FILE", help="also write the figures to this file"
    )
    _add_model(parser.add_argument_group("model"))
    add_engine(parser.add_argument_group("computing"))


def _add_model(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--separator",
        default=RunnerOptions().separator,
        metavar="NAME",
        help="for joint, mdr and mbp: separation method (default %(default)s)",
    )
    group.add_argument(
        "--confidence-weights", action="store_true", help="for joint and mdr: as for isc decompose"
    )
    group.add_argument(
        "--light-prior",
        type=current_name("light_prior"),
        choices=LIGHT_PRIORS,
        help=_PRIOR.format(LightPrior.DATASET),
    )
    group.add_argument(
        "--shape-prior",
        type=current_name("shape_prior"),
        choices=SHAPE_PRIORS,
        help=_PRIOR.format(ShapePrior.SILHOUETTE),
    )
    group.add_argument(
        "--priors",
        type=Path,
        metavar="FILE",
        help="priors written by isc fit-priors (default: those of the package)",
    )


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command.

    Parameters
    ----------
    options : argparse.Namespace
    monitor : Monitor

    Returns
    -------
    list of str
        Lines to print.
    """
    if options.json is not None:
        require_writable_file(options.json)
    model = options.model or ("joint" if options.input == "original" else "sirfs")
    runner_options = RunnerOptions(
        model, options.separator, options.engine, options.threads, options.confidence_weights,
        options.light_prior, options.shape_prior, Protocol(options.protocol),
    )  # fmt: skip
    runner_options.check()
    prior_set = shipped_prior_set() if options.priors is None else load_prior_set(options.priors)
    report = evaluate(
        options.root,
        objects=options.objects,
        illuminations=_illuminations(options.illumination),
        input=options.input,
        model=model,
        protocol=options.protocol,
        runner=make_runner(runner_options, prior_set),
        monitor=monitor,
    )
    if options.json is not None:
        with new_file(options.json) as partial:
            partial.write_text(json.dumps(report.to_json(), indent=2) + "\n", encoding="utf-8")
    return [report.table()]


def _illuminations(chosen: str | None) -> tuple[str, ...] | None:
    if chosen is None:
        return None
    return ILLUMINATIONS if chosen == "both" else (chosen,)
