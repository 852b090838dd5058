"""Regression bounds: how bad a figure may be before the run is rejected.

A bound is broken only where the whole interval of the figure lies beyond it, so that luck with the
scenes rejects nothing. Slices of fewer than `FEWEST` scenes are not judged. Bounds taken from a run
lie beyond its interval by the metric's margin.

Limits: bounds speak of the kind of scenes that they were taken from; another dataset needs its own.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.io.json_files import numbers, read_json

from ..stages.types import Metric
from .bootstrap import Interval
from .figures import Figure
from .slices import EVERYTHING

SCHEMA_VERSION = 1
FEWEST = 5
SHIPPED = Path(__file__).with_name("bounds.json")
# Slices that mean the same in every dataset; the limits of "mask size" come from the scenes at
# hand.
_LASTING = (EVERYTHING, "gloss", "light", "specular share")


@dataclass(frozen=True)
class Bound:
    """`stage`, `metric`, slice (`kind`, `value`): which figure.

    `limit`: the worst that it may be.
    """

    stage: str
    metric: str
    kind: str
    value: str
    limit: float


@dataclass(frozen=True)
class Verdict:
    """A bound, the figure that it was held against, and whether it is broken."""

    bound: Bound
    interval: Interval
    broken: bool

    @property
    def text(self) -> str:
        """The verdict in words."""
        place = "" if self.bound.kind == EVERYTHING else f" ({self.bound.kind}: {self.bound.value})"
        low, high = self.interval.low, self.interval.high
        span = "" if low is None or high is None else f" [{low:.4g}, {high:.4g}]"
        beyond = "is beyond" if self.broken else "keeps"
        return f"{self.bound.stage} {self.bound.metric}{place}: {self.interval.value:.4g}{span} {beyond} the bound {self.bound.limit:.4g}"


def read_bounds(path: Path) -> tuple[Bound, ...]:
    """Reads a file of `write_bounds`. Raises `InputError` for anything else."""
    if not path.exists():
        raise InputError(f"{path} does not exist: --update-bounds writes a file of bounds")
    content = read_json(path, "--update-bounds writes a file of bounds")
    entries = (
        content.get("bounds")
        if isinstance(content, dict) and content.get("schema_version") == SCHEMA_VERSION
        else None
    )
    if not isinstance(entries, list):
        raise InputError(
            f"{path} is not a file of bounds of version {SCHEMA_VERSION}: --update-bounds writes one"
        )
    return tuple(_bound(entry, path) for entry in entries)


def write_bounds(path: Path, bounds: Sequence[Bound]) -> None:
    """Writes a file of bounds, whole or not at all.

    Raises `InputError` where that is not possible.
    """
    content = {"schema_version": SCHEMA_VERSION, "bounds": [asdict(bound) for bound in bounds]}
    with new_file(path) as partial:
        partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def bounds_from(figures: Sequence[Figure]) -> tuple[Bound, ...]:
    """Bounds that this run keeps: its intervals, widened by each metric's margin; of slices that
    last and are large enough to judge.
    """
    return tuple(
        Bound(
            figure.stage,
            figure.metric.name,
            figure.group.kind,
            figure.group.value,
            _limit(figure.metric, figure.interval),
        )
        for figure in figures
        if figure.group.kind in _LASTING and figure.interval.scenes >= FEWEST
    )


def judge(bounds: Sequence[Bound], figures: Sequence[Figure]) -> tuple[Verdict, ...]:
    """Holds figures against the bounds that name them; bounds of what was not measured are passed
    over.
    """
    known = {
        (f.stage, f.metric.name, f.group.kind, f.group.value): f
        for f in figures
        if f.interval.scenes >= FEWEST
    }
    pairs = [
        (bound, known.get((bound.stage, bound.metric, bound.kind, bound.value))) for bound in bounds
    ]
    return tuple(
        Verdict(bound, f.interval, _broken(bound, f)) for bound, f in pairs if f is not None
    )


def _broken(bound: Bound, figure: Figure) -> bool:
    low, high = figure.interval.low, figure.interval.high
    if low is None or high is None:
        return False
    return high < bound.limit if figure.metric.larger_is_better else low > bound.limit


def _limit(metric: Metric, interval: Interval) -> float:
    low, high = interval.low or 0.0, interval.high or 0.0
    if metric.geometric:
        limit = low / (1 + metric.margin) if metric.larger_is_better else high * (1 + metric.margin)
    else:
        limit = low - metric.margin if metric.larger_is_better else high + metric.margin
    return float(f"{limit:.4g}")


def _bound(entry: object, path: Path) -> Bound:
    names = ("stage", "metric", "kind", "value")
    if (
        not isinstance(entry, dict)
        or set(entry) != {*names, "limit"}
        or not all(isinstance(entry[name], str) for name in names)
    ):
        raise InputError(
            f"{path}: a bound has stage, metric, kind, value (texts) and limit (a number), not {str(entry)[:80]}"
        )
    limit = entry["limit"]
    if isinstance(limit, bool) or not isinstance(limit, int | float) or numbers(limit, ()) is None:
        raise InputError(
            f"{path}: the limit of {entry['stage']} {entry['metric']} has to be a number, not {str(limit)[:40]}"
        )
    return Bound(entry["stage"], entry["metric"], entry["kind"], entry["value"], float(limit))
