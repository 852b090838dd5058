"""`isc batch`: many photos, on all cores of this machine or on a cluster."""

import argparse
import importlib.util
import sys
from dataclasses import fields
from pathlib import Path

from ...batch.engine import Crew
from ...batch.item import DONE, FAILED, SKIPPED, ImageRecipe
from ...batch.run_batch import Batch, run_batch
from ...decompose.settings import Settings
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
    """Add the command to the parser."""
    parser = add_command(
        commands,
        "batch",
        run,
        "isc decompose for many photos, resumable",
        "Decomposes many photos, one folder each in DIR. Writes summary.html (look at this first), "
        "summary.csv, summary.jsonl and "
        "failures.jsonl beside them.",
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
    _add_crew(parser)
    add_limits(parser)
    parser.add_argument(
        "--timeout",
        type=positive,
        default=0.0,
        metavar="SECONDS",
        help="give up an image that takes longer (default: never)",
    )


def _add_crew(parser: argparse.ArgumentParser) -> None:
    usual = Crew()
    crew = parser.add_argument_group("who works")
    crew.add_argument(
        "--workers",
        type=count,
        default=usual.workers,
        metavar="N",
        help="images at once (default 0: one for each core)",
    )
    crew.add_argument(
        "--memory", default=usual.memory, metavar="SIZE",
        help="of each worker, such as 4GB; one that needs more is ended (default: a fair share)",
    )  # fmt: skip
    crew.add_argument(
        "--scheduler",
        default=usual.scheduler,
        metavar="ADDRESS",
        help="work on this Dask cluster instead of this machine",
    )
    add_engine(parser, "threads for each image (0: the cores shared among the workers)")


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command; raise `Rejected` if images failed."""
    settings = Settings(**{f.name: getattr(options, f.name) for f in fields(Settings)})
    batch = Batch(
        options.inputs, options.output, options.masks, ImageRecipe(settings, options.transfer),
        Crew(options.workers, options.threads, options.memory, options.scheduler),
        limits_of(options), options.timeout, options.arrays, options.priors,
    )  # fmt: skip

    def announce(line: str) -> None:
        missing = (
            "" if importlib.util.find_spec("bokeh") else " (its pages need `pip install bokeh`)"
        )
        print(f"isc: {line}{missing}", file=sys.stderr)

    counts = run_batch(batch, monitor, (lambda line: None) if options.quiet else announce)
    look = f"look at {options.output / 'summary.html'}"
    if counts[FAILED]:
        raise Rejected(
            f"{counts[FAILED]} of {sum(counts.values())} images failed, the reasons are in "
            f"failures.jsonl: {look}"
        )
    done, there = counts[DONE], counts[SKIPPED]
    return hints(
        options,
        f"{done} image{'s' * (done != 1)} done, {there} {'was' if there == 1 else 'were'} there "
        f"already: {look}",
    )
