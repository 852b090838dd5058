"""`isc batch`: many photos, on all cores of this machine or on a cluster."""

import argparse
import importlib.util
import sys
from dataclasses import fields
from pathlib import Path

from ...batch.engine import Crew
from ...batch.item import DONE, FAILED, SKIPPED, ImageRecipe
from ...batch.run_batch import Batch, run_batch
from ...decomposition.settings import Settings
from ...errors import Rejected
from ...progress import Monitor
from ..interface.options import (
    Commands,
    add_command,
    add_engine,
    add_limits,
    add_settings,
    add_transfer,
    count,
    hints,
    limits_of,
    positive,
)

_EXAMPLES = """  isc batch photos -o results       all photos; cup_mask.png masks cup.jpg
  isc batch 'catalogue/**/*.jpg' --masks masks -o results --timeout 300
  isc batch list.csv -o results --workers 4 --memory 4GB
  isc batch list.jsonl -o /net/results --scheduler tcp://node7:8786

A manifest is CSV with a header (image,mask,name,max_size,...) or JSON lines
({"image": "cup.png", "options": {"max_size": 256}}); its paths are relative to its folder.
Inputs may be URLs that fsspec supports (s3://bucket/photos). Run the same command again to
resume: finished images are skipped. Exit code 1: some images failed, see failures.jsonl."""


def declare(commands: Commands) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : object
        Returned by `add_subparsers`.
    """
    parser = add_command(
        commands,
        "batch",
        run,
        "isc decompose for many photos, resumable",
        "Decomposes many photos, one folder each in DIR. Writes summary.html (start here), "
        "summary.csv, summary.jsonl and "
        "failures.jsonl next to them.",
        _EXAMPLES,
    )
    parser.add_argument(
        "inputs",
        nargs="+",
        metavar="INPUT",
        help="a folder, photo, quoted pattern, URL, or a .csv or .jsonl manifest",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DIR",
        help="the folder to write; finished results are kept",
    )
    parser.add_argument(
        "--masks",
        metavar="DIR",
        help="a folder with the masks of all photos: cup.png or cup_mask.png for cup.jpg",
    )
    add_transfer(parser)
    add_settings(parser)
    _add_workers(parser)
    add_limits(parser)
    parser.add_argument(
        "--timeout",
        type=positive,
        default=0.0,
        metavar="SECONDS",
        help="stop images that take longer (default: no limit)",
    )


def _add_workers(parser: argparse.ArgumentParser) -> None:
    defaults = Crew()
    crew = parser.add_argument_group("workers")
    crew.add_argument(
        "--workers",
        type=count,
        default=defaults.workers,
        metavar="N",
        help="images processed at once (default 0: one per core)",
    )
    crew.add_argument(
        "--memory", default=defaults.memory, metavar="SIZE",
        help="memory of each worker, such as 4GB; one that exceeds it is stopped (default: equal)",
    )  # fmt: skip
    crew.add_argument(
        "--scheduler",
        default=defaults.scheduler,
        metavar="ADDRESS",
        help="use this Dask cluster instead of this machine",
    )
    add_engine(parser, "threads per image (0: the cores, shared among the workers)")


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
    batch = Batch(
        options.inputs, options.output, options.masks, ImageRecipe(settings, options.transfer),
        Crew(options.workers, options.threads, options.memory, options.scheduler),
        limits_of(options), options.timeout, options.arrays, options.priors,
    )  # fmt: skip

    def announce(line: str) -> None:
        missing = "" if importlib.util.find_spec("bokeh") else " (requires `pip install bokeh`)"
        print(f"isc: {line}{missing}", file=sys.stderr)

    counts = run_batch(batch, monitor, (lambda line: None) if options.quiet else announce)
    where = f"see {options.output / 'summary.html'}"
    if counts[FAILED]:
        raise Rejected(
            f"{counts[FAILED]} of {sum(counts.values())} images failed (reasons in "
            f"failures.jsonl): {where}"
        )
    done, skipped = counts[DONE], counts[SKIPPED]
    return hints(
        options,
        f"{done} image{'s' * (done != 1)} done, {skipped} already finished: {where}",
    )
