"""All items, in the order of the thesis' lists."""

import importlib
from functools import cache

from isc_core.errors import InputError

from .report.item import ThesisItem

_MODULES = (
    "introduction",
    "background",
    "framework",
    "filters",
    "applications",
    "catalogue",
    "thresholds",
    "threshold_figures",
    "segmentation",
    "removal",
    "sparse_coding",
    "characteristics",
    "sheets",
)


@cache
def all_items() -> tuple[ThesisItem, ...]:
    """Every item. matplotlib and scikit-image have to be installed."""
    modules = [importlib.import_module(f".items.{name}", __package__) for name in _MODULES]
    found: list[ThesisItem] = sorted(
        (item for module in modules for item in module.ITEMS), key=lambda item: item.order
    )
    names = [item.name for item in found]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"listed twice: {', '.join(sorted(twice))}")
    return tuple(found)


def find_item(kind: str, number: str) -> ThesisItem:
    """One item. Raises `InputError` that names the nearest numbers where there is none."""
    known = {item.number: item for item in all_items() if item.kind == kind}
    if number not in known:
        near = sorted(known, key=lambda other: _distance(number, other))[:3]
        raise InputError(
            f"there is no {kind} {number!r}: the nearest are {', '.join(near)} (`isc thesis list` shows all)"
        )
    return known[number]


def _distance(asked: str, known: str) -> tuple[float, float]:
    """How far apart two numbers like "4.5" are: by chapter, then by what follows; words are
    infinitely far.
    """
    try:
        chapter, _, place = asked.partition(".")
        wanted = float(chapter), float(place or 0)
    except ValueError:
        wanted = float("inf"), float("inf")
    own = [float(part) for part in known.split(".")]
    return abs(wanted[0] - own[0]), abs(wanted[1] - own[1])
