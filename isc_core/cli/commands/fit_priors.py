"""`isc fit-priors`: the statistics of shapes, reflectances and lights, learnt from objects with
ground truth.
"""

import argparse
from pathlib import Path

from ...datasets.mit_berkeley import list_objects, load_natural_lights
from ...errors import InputError
from ...io.atomic import require_writable_file
from ...numerics.jit import ensure_cache_folder
from ...progress import Monitor
from ..interface.parser import describe, hints
from ..interface.values import names

_EXAMPLES = """  isc fit-priors DATA -o priors.npz
  isc fit-priors DATA --leave-out cup1,cup2 -o without-cups.npz"""


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
        "Fit the priors of SIRFS to the objects of a data set (the MIT-Berkeley set, with "
        "natural_lights.mat) and write them to a file "
        "for --priors.",
        examples=_EXAMPLES,
    )
    parser.add_argument("root", metavar="ROOT", type=Path, help="the folder of the data set")
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument(
        "--objects", type=names, metavar="a,b", help="fit to these objects (default: all)"
    )
    chosen.add_argument(
        "--leave-out", type=names, metavar="a,b", help="fit to all objects except these"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help="the file to write (.npz)"
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
    ensure_cache_folder()
    # These modules compile functions, which needs the cache folder and slows down start-up.
    from ...prior_fitting.fit import fit_priors
    from ...prior_fitting.statistics import collect_statistics
    from ...prior_fitting.training_objects import read_training_objects
    from ...sirfs.priors.prior_file import save_prior_set

    require_writable_file(options.output)
    chosen = _chosen(options.root, options.objects, options.leave_out)
    lights = load_natural_lights(options.root)
    objects = read_training_objects(options.root, chosen, monitor.part(0.0, 0.2))
    statistics = collect_statistics(objects, monitor.part(0.2, 0.4))
    priors = fit_priors(statistics, lights, monitor=monitor.part(0.4, 1.0))
    save_prior_set(options.output, priors)
    return hints(options, f"{options.output}: priors of {', '.join(priors.record.objects)}")


def _chosen(
    root: Path, selected: tuple[str, ...] | None, excluded: tuple[str, ...] | None
) -> tuple[str, ...]:
    available = list_objects(root, "laboratory")
    for name in (selected or ()) + (excluded or ()):
        if name not in available:
            raise InputError(f"unknown object '{name}': choose from {', '.join(available)}")
    chosen = (
        tuple(dict.fromkeys(selected))
        if selected
        else tuple(name for name in available if name not in (excluded or ()))
    )
    if len(chosen) < 2:
        raise InputError("priors need at least two objects: name more, or leave out fewer")
    return chosen
