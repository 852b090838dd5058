"""How much relief `isc decompose` recovers, and how much it invents on print.

  python -m benchmarks.detail.recovered SET --rows FILE [--set NAME=VALUE]... [--solve-size N]
  [--count N] [--kind relief|print|mixed|parts|drawn]
  python -m benchmarks.detail.recovered SET --rows FILE --normals DIR

SET is a folder of `benchmarks.detail.sets`, the measure that of `benchmarks.detail.measure`. By
default the pipeline that users run is measured, with its settings (`--set detail=512`);
`--solve-size` solves SIRFS alone at another size than the shipped one. `--normals` scores the files
`NAME.npy` (H, W, 3) of a folder instead. A row is stored for each body, so that an interrupted run
continues.

Table: relief, mixed and parts, the share of the true energy explained, mean over bodies; print and
drawn, the mean energy that is invented over the mean true energy of the relief bodies; base, the
median over bodies of the median angle of the overall shape. Intervals are of 2,000 sets of
resampled bodies.
"""

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import isc_core
from benchmarks.bootstrap import bootstrap_samples, interval
from isc_core.decomposition.layers import normals_and_shading
from isc_core.decomposition.models import solve
from isc_core.decomposition.settings import Settings
from isc_core.decomposition.task import DecompositionTask, SolveOptions
from isc_core.errors import InputError
from isc_core.photo import read_photo

from .body_rows import body_rows
from .measure import OCTAVES, at_size, score_relief
from .rendering import SetKind
from .sets import PHOTO, Truth, read_truth
from .settings import settings_of

Estimator = Callable[[Path, Truth], np.ndarray]


def pipeline_normals(settings: Settings) -> Estimator:
    """Make an estimator of the pipeline that users run.

    Parameters
    ----------
    settings : Settings

    Returns
    -------
    callable
        From a body's folder and its truth to normals (H, W, 3) at the photo's size.
    """

    def estimate(body: Path, truth: Truth) -> np.ndarray:
        result = isc_core.decompose(body / PHOTO, settings=settings)
        return at_size(result.normal, result.mask, truth.mask.shape)

    return estimate


def solver_normals(settings: Settings, solve_size: int) -> Estimator:
    """Make an estimator that solves SIRFS at a size of its own.

    Parameters
    ----------
    settings : Settings
    solve_size : int
        Long side of the object, pixels.

    Returns
    -------
    callable
        See `pipeline_normals`.
    """

    def estimate(body: Path, truth: Truth) -> np.ndarray:
        photo = read_photo(body / PHOTO).resized_to_object(settings.max_size)
        options = SolveOptions(solve_size=solve_size, fit_lobe=False, check_assumptions=False)
        found = solve(DecompositionTask(photo, photo, settings, options=options))
        return at_size(
            normals_and_shading(found.height, found.light, photo.mask)[0],
            photo.mask,
            truth.mask.shape,
        )

    return estimate


def stored_normals(folder: Path) -> Estimator:
    """Make an estimator that reads files.

    Parameters
    ----------
    folder : Path
        With `NAME.npy`.

    Returns
    -------
    callable
        See `pipeline_normals`.
    """

    def estimate(body: Path, truth: Truth) -> np.ndarray:
        path = folder / f"{body.name}.npy"
        if not path.is_file():
            raise InputError(f"{path} is missing: write the normals of every body, or use --count")
        found = np.load(path, allow_pickle=False)
        known = np.isfinite(found).all(2) & (np.abs(found).sum(2) > 0)
        return at_size(np.nan_to_num(found), known, truth.mask.shape)

    return estimate


def score_body(body: Path, estimator: Estimator) -> dict[str, Any]:
    """Compare the normals that are recovered of one body with the truth.

    Parameters
    ----------
    body : Path
        Its folder.
    estimator : callable
        See `pipeline_normals`.

    Returns
    -------
    dict of str to Any
        Seconds, and the figures of `measure.ReliefScore`.
    """
    truth, start = read_truth(body), time.perf_counter()
    estimated = estimator(body, truth)
    seconds = time.perf_counter() - start
    found = score_relief(estimated, truth.normal, truth.mask, truth.smooth)
    figures = {name: np.asarray(one).tolist() for name, one in asdict(found).items()}
    return {"seconds": seconds, **figures}


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Format the figures.

    Parameters
    ----------
    rows : sequence of mapping
        Of `body_rows`, measured by `score_body`.

    Returns
    -------
    str
        A Markdown table.
    """
    of_kind = {kind: [row for row in rows if row["body"].startswith(kind)] for kind in SetKind}
    lines = [
        "| figure | bodies | " + " | ".join(f"{one} px" for one in OCTAVES) + " | base | seconds |",
        "|---" * (len(OCTAVES) + 4) + "|",
    ]
    rng = np.random.default_rng(0)
    for kind in (SetKind.RELIEF, SetKind.MIXED, SetKind.PARTS):
        if bodies := of_kind[kind]:
            explained = np.array([row["explained"] for row in bodies])
            again = bootstrap_samples(explained, rng).mean(1)
            lines.append(_line(f"{kind}: explained", bodies, explained.mean(0), again))
    relief = of_kind[SetKind.RELIEF]
    for kind in (SetKind.PRINT, SetKind.DRAWN):
        if relief and (bodies := of_kind[kind]):
            energy = np.array([row["energy"] for row in relief])
            error = np.array([row["error"] for row in bodies])
            above = bootstrap_samples(error, rng).mean(1)
            below = bootstrap_samples(energy, rng).mean(1)
            figures = error.mean(0) / energy.mean(0)
            lines.append(_line(f"{kind}: invented", bodies, figures, above / below))
    return "\n".join(lines)


def _line(
    title: str, rows: Sequence[Mapping[str, Any]], figures: np.ndarray, again: np.ndarray
) -> str:
    low, high = interval(again)
    cells = [f"{f:.3f} ({a:.3f} to {b:.3f})" for f, a, b in zip(figures, low, high, strict=True)]
    base, seconds = (float(np.median([row[name] for row in rows])) for name in ("base", "seconds"))
    return f"| {title} | {len(rows)} | {' | '.join(cells)} | {base:.2f} | {seconds:.1f} |"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("folder", type=Path, metavar="SET", help="folder of benchmarks.detail.sets")
    add("--rows", type=Path, required=True, metavar="FILE", help="JSON lines to append to")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="a setting")
    add("--solve-size", type=int, metavar="N", help="solve SIRFS alone at this size")
    add("--normals", type=Path, metavar="DIR", help="score stored normals")
    add("--kind", type=SetKind, choices=list(SetKind), help="one kind of bodies alone")
    add("--count", type=int, help="bodies of each kind")
    given = parser.parse_args()
    kinds = list(SetKind) if given.kind is None else [given.kind]
    try:
        settings = settings_of(given.set, Settings(max_size=0, threads=1))
        if given.normals is not None:
            estimator, key = stored_normals(given.normals), str(given.normals.resolve())
        elif given.solve_size is not None:
            estimator = solver_normals(settings, given.solve_size)
            key = f"solve_size={given.solve_size} {settings}"
        else:
            estimator, key = pipeline_normals(settings), str(settings)
        rows = []
        measure = partial(score_body, estimator=estimator)
        for row in body_rows(given.folder, given.rows, kinds, given.count, key, measure):
            printed = row["body"].startswith((SetKind.PRINT, SetKind.DRAWN))
            shown = "error" if printed else "explained"
            print(row["body"], shown, *(f"{value:.3g}" for value in row[shown]), flush=True)
            rows.append(row)
    except InputError as error:
        parser.error(str(error))
    print(table(rows))


if __name__ == "__main__":
    main()
