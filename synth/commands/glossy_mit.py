"""`isc synth glossy-mit`: the MIT-Berkeley objects with strong highlights and ground truth of every
layer.
"""

import argparse
from pathlib import Path

from isc_core.cli.interface.parser import describe, hints
from isc_core.cli.interface.values import count, names, positive
from isc_core.progress import Monitor

from ..glossy_mit.generate import make_glossy
from ..glossy_mit.settings import GlossySettings

SUMMARY = "MIT-Berkeley objects with strong highlights"

_EXAMPLES = """  isc synth glossy-mit DATA -o glossy
  isc evaluate glossy/level-25_natural-area --dataset mit-berkeley --input original --model mdr

DIR gets one data set per level and light (natural, laboratory, and each with an added panel), in
the layout of the MIT-Berkeley set. An interrupted run continues in the same folder. The output
derives from research data and must not be redistributed."""


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
        "Add a specular layer of a given share to the MIT-Berkeley objects, with the set's own "
        "reflectance, shape and light.",
        examples=_EXAMPLES,
    )
    usual = GlossySettings()
    parser.add_argument("root", metavar="ROOT", type=Path, help="folder of the MIT-Berkeley set")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="output folder"
    )
    parser.add_argument(
        "--objects", type=names, metavar="a,b", help="objects to use (default: all)"
    )
    parser.add_argument(
        "--levels",
        type=_levels,
        default=usual.levels,
        metavar="a,b",
        help="specular share of the light in per cent (default: 10,25,50)",
    )
    parser.add_argument(
        "--exponent",
        type=positive,
        default=usual.exponent,
        metavar="P",
        help="Blinn-Phong exponent of the specular lobe (default: %(default)g)",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=usual.seed,
        metavar="S",
        help="seed of the panels' positions (default: %(default)s)",
    )
    parser.add_argument(
        "--physical",
        action="store_true",
        help="render the sets with shadows too, to DIR/physical",
    )
    parser.add_argument(
        "--samples",
        type=count,
        default=usual.samples,
        metavar="N",
        help="light paths per pixel for --physical (default: %(default)s)",
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
    InputError
        For invalid input.
    """
    settings = GlossySettings(
        options.levels, options.samples, options.seed, options.exponent, options.physical
    )
    outcome = make_glossy(options.root, options.output, settings, options.objects, monitor)
    kept = f", {outcome.kept} kept" if outcome.kept else ""
    example = f"isc evaluate {options.output / outcome.roots[0]} --dataset mit-berkeley"
    return hints(options, f"{outcome.made} objects made{kept}; next: {example} --input original")


def _levels(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a list of percentages, such as 10,25,50"
        ) from None
