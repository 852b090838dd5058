"""`isc synth glossy-mit`: the MIT-Berkeley objects with strong highlights, and the truth of every
layer.
"""

import argparse
from pathlib import Path

from isc_core.cli.interface.options import Commands, add_command, count, hints, names, positive
from isc_core.progress import Monitor

from ..glossy_mit.generate import make_glossy
from ..glossy_mit.settings import GlossySettings

_EXAMPLES = """  isc synth glossy-mit DATA -o glossy
  isc evaluate glossy/level-25_natural-area --dataset mit-berkeley --input original --model mdr

DIR gets a data set for each level and light (natural, laboratory, and each with a panel beside it), laid out as the MIT-Berkeley set.
An interrupted run goes on in the same folder. What is made derives from research data and must not be redistributed."""


def declare(commands: Commands) -> None:
    """Adds the command to the parser."""
    parser = add_command(
        commands,
        "glossy-mit",
        run,
        "MIT-Berkeley's objects with strong highlights",
        "Adds a gloss to the MIT-Berkeley objects: the set's own reflectance, shape and light, and a specular layer of a given share.",
        _EXAMPLES,
    )
    usual = GlossySettings()
    parser.add_argument(
        "root", metavar="ROOT", type=Path, help="the folder of the MIT-Berkeley set"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="the folder to write"
    )
    parser.add_argument("--objects", type=names, metavar="a,b", help="their names (default: all)")
    parser.add_argument(
        "--levels",
        type=_levels,
        default=usual.levels,
        metavar="a,b",
        help="per cent of the light that is specular (default 10,25,50)",
    )
    parser.add_argument(
        "--exponent",
        type=positive,
        default=usual.exponent,
        metavar="P",
        help="of the gloss (default %(default)g)",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=usual.seed,
        metavar="S",
        help="of where the panels stand (default %(default)s)",
    )
    parser.add_argument(
        "--physical",
        action="store_true",
        help="also render the sets with shadows, into DIR/physical",
    )
    parser.add_argument(
        "--samples",
        type=count,
        default=usual.samples,
        metavar="N",
        help="light paths a pixel of --physical (default %(default)s)",
    )


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Does the work."""
    settings = GlossySettings(
        options.levels, options.samples, options.seed, options.exponent, options.physical
    )
    outcome = make_glossy(options.root, options.output, settings, options.objects, monitor)
    kept = f", {outcome.kept} were there already" if outcome.kept else ""
    return hints(
        options,
        f"{outcome.made} objects made{kept}; for example: isc evaluate {options.output / outcome.roots[0]} "
        "--dataset mit-berkeley --input original",
    )


def _levels(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not per cents with commas between them, like 10,25,50"
        ) from None
