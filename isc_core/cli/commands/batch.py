"""`isc batch`: many photos, on all cores of this machine or on a cluster."""

import argparse
import sys
from dataclasses import fields

from ...batch.engine import WorkerOptions
from ...batch.item import DONE, FAILED, SKIPPED, ImageRecipe
from ...batch.run_batch import Batch, run_batch
from ...decomposition.settings import Settings
from ...errors import Rejected
from ...progress import Monitor
from ..interface.mask_options import add_each
from ..interface.options import (
    add_engine,
    add_limits,
    add_main_settings,
    add_model_settings,
    add_output,
    add_transfer,
    limits_of,
    names_table,
)
from ..interface.parser import describe, hints
from ..interface.terminal import print_note
from ..interface.values import count, location, positive

_EXAMPLES = """  isc batch photos -o results       all photos; cup_mask.png masks cup.jpg
  isc batch 'catalogue/**/*.jpg' --masks masks -o results --timeout 300
  isc batch shelves --each -o results      each object of each photo: results/shelf/1, /2, ...
  isc batch list.csv -o results --workers 4 --memory 4GB
  isc batch list.jsonl -o /net/results --scheduler tcp://node7:8786

A manifest is CSV with a header (image,mask,name,max_size,...) or JSON lines
({"image": "cup.png", "options": {"max_size": 256}}); its paths are relative to its folder.
Inputs may be URLs that fsspec supports (s3://bucket/photos). Run the same command again to
resume: finished images are skipped. Exit code 1: some images failed, see failures.jsonl."""


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
        "Decompose many photos, each into its own folder in DIR. Writes summary.html (start here), "
        "summary.csv, summary.jsonl and "
        "failures.jsonl next to them.",
        examples=_EXAMPLES,
        more=names_table(),
    )
    parser.add_argument(
        "inputs",
        nargs="+",
        metavar="INPUT",
        help="a folder, photo, quoted pattern, URL, or a .csv or .jsonl manifest",
    )
    main = parser.add_argument_group("main options")
    add_output(main, "the folder to write; finished results are kept")
    main.add_argument(
        "--masks",
        type=location(),
        metavar="DIR",
        help="a folder with the masks of all photos: cup_mask.png or cup.png for cup.jpg",
    )
    add_each(main, "DIR/PHOTO/1, DIR/PHOTO/2 and so on, from left to right")
    add_main_settings(main)
    main.add_argument(
        "--timeout",
        type=positive,
        default=0.0,
        metavar="SECONDS",
        help="stop images that take longer (default: no limit)",
    )
    reading = parser.add_argument_group("reading the photos")
    add_transfer(reading)
    add_limits(reading)
    add_model_settings(parser)
    _add_workers(parser)


def _add_workers(parser: argparse.ArgumentParser) -> None:
    defaults = WorkerOptions()
    workers = parser.add_argument_group("workers")
    workers.add_argument(
        "--workers",
        type=count,
        default=defaults.workers,
        metavar="N",
        help="images processed at once (default 0: one per core)",
    )
    workers.add_argument(
        "--memory", default=defaults.memory, metavar="SIZE",
        help="memory limit of each worker, such as 4GB; a worker that exceeds it is stopped "
        "(default: equal shares)",
    )  # fmt: skip
    workers.add_argument(
        "--scheduler",
        default=defaults.scheduler,
        metavar="ADDRESS",
        help="run on this Dask cluster instead of this machine",
    )
    add_engine(workers, "threads per image (0: the cores are shared among the workers)")


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

    Raises
    ------
    Rejected
        If images failed.
    """
    settings = Settings(**{f.name: getattr(options, f.name) for f in fields(Settings)})
    recipe = ImageRecipe(settings, options.transfer, options.each)
    batch = Batch(
        options.inputs, options.output, options.masks, recipe,
        WorkerOptions(options.workers, options.threads, options.memory, options.scheduler),
        limits_of(options), options.timeout, options.arrays, options.priors,
    )  # fmt: skip

    def announce(line: str) -> None:
        if not options.quiet:
            print_note(line, sys.stderr)

    counts = run_batch(batch, monitor, announce)
    where = f"see {options.output / 'summary.html'}"
    if counts[FAILED]:
        raise Rejected(
            f"{counts[FAILED]} of {sum(counts.values())} results failed (reasons in "
            f"failures.jsonl): {where}"
        )
    done, skipped = counts[DONE], counts[SKIPPED]
    return hints(
        options,
        f"{done} result{'s' * (done != 1)} done, {skipped} already finished: {where}",
    )
