"""Regression bounds: the worst value of a figure that a run may have.

A bound is violated only if the whole interval of the figure lies beyond it, so that no run is
rejected because of the choice of scenes alone. Slices of fewer than `FEWEST` scenes are not
compared. Bounds taken from a run lie beyond its interval by the metric's margin.

Limits: bounds apply to the kind of scenes from which they were derived; other data sets need other
bounds.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.io.json_files import numbers, read_json

from ...dataset.reading import current_gloss_class
from ..stages.types import Metric
from .bootstrap import Interval
from .figures import Figure
from .slices import EVERYTHING

SCHEMA_VERSION = 2  # 2: the gloss class "matt" is called "diffuse"
_READABLE = (1, SCHEMA_VERSION)
FEWEST = 5
SHIPPED = Path(__file__).with_name("bounds.json")
# Slices that mean the same in every data set; the limits of "mask size" depend on the scenes.
_LASTING = (EVERYTHING, "gloss", "light", "specular share")


@dataclass(frozen=True)
class Bound:
    """Worst allowed value of one figure.

    Attributes
    ----------
    stage, metric : str
        The figure.
    kind, value : str
        The slice.
    limit : float
        Worst allowed value.
    """

    stage: str
    metric: str
    kind: str
    value: str
    limit: float


@dataclass(frozen=True)
class Verdict:
    """The result of one bound.

    Attributes
    ----------
    bound : Bound
        The bound.
    interval : Interval
        The figure that was compared with it.
    broken : bool
        Whether the bound is violated.
    """

    bound: Bound
    interval: Interval
    broken: bool

    @property
    def text(self) -> str:
        """The verdict as one line."""
        place = "" if self.bound.kind == EVERYTHING else f" ({self.bound.kind}: {self.bound.value})"
        low, high = self.interval.low, self.interval.high
        span = "" if low is None or high is None else f" [{low:.4g}, {high:.4g}]"
        verb = "violates" if self.broken else "meets"
        figure = f"{self.bound.stage} {self.bound.metric}{place}: {self.interval.value:.4g}{span}"
        return f"{figure} {verb} the bound {self.bound.limit:.4g}"


def read_bounds(path: Path) -> tuple[Bound, ...]:
    """Read a file of `write_bounds`.

    Parameters
    ----------
    path : Path
        A JSON file of schema 1 or 2. Schema 1 called the gloss class "diffuse" by its old name
        "matt".

    Returns
    -------
    tuple of Bound
        The bounds.

    Raises
    ------
    InputError
        If the file is missing, damaged or of another kind.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist: --update-bounds writes a file of bounds")
    content = read_json(path, "--update-bounds writes a file of bounds")
    known = isinstance(content, dict) and content.get("schema_version") in _READABLE
    entries = content.get("bounds") if known else None
    if not isinstance(entries, list):
        raise InputError(
            f"{path} is not a bounds file of schema {SCHEMA_VERSION}: --update-bounds writes one"
        )
    return tuple(_bound(entry, path) for entry in entries)


def write_bounds(path: Path, bounds: Sequence[Bound]) -> None:
    """Write a file of bounds, completely or not at all.

    Parameters
    ----------
    path : Path
        The JSON file.
    bounds : sequence of Bound
        The bounds.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    content = {"schema_version": SCHEMA_VERSION, "bounds": [asdict(bound) for bound in bounds]}
    with new_file(path) as partial:
        partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def bounds_from(figures: Sequence[Figure]) -> tuple[Bound, ...]:
    """Return bounds that this run meets: its intervals, widened by each metric's margin.

    Parameters
    ----------
    figures : sequence of Figure
        The figures of the run.

    Returns
    -------
    tuple of Bound
        For slices that exist in every data set and are large enough.
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
    """Compare figures with bounds.

    Parameters
    ----------
    bounds : sequence of Bound
        The bounds; those of figures that were not measured are skipped.
    figures : sequence of Figure
        The figures of the run.

    Returns
    -------
    tuple of Verdict
        One per bound that could be compared.
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
            f"{path}: a bound has stage, metric, kind, value (strings) and limit (a number), "
            f"not {str(entry)[:80]}"
        )
    limit = entry["limit"]
    if isinstance(limit, bool) or not isinstance(limit, int | float) or numbers(limit, ()) is None:
        figure = f"{entry['stage']} {entry['metric']}"
        raise InputError(f"{path}: the limit of {figure} must be a number, not {str(limit)[:40]}")
    value = current_gloss_class(entry["value"]) if entry["kind"] == "gloss" else entry["value"]
    return Bound(entry["stage"], entry["metric"], entry["kind"], value, float(limit))
