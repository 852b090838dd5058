"""List of all items, in the order of the thesis."""

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
    """Return every item.

    Returns
    -------
    tuple of ThesisItem
        Tables first, then figures, by number. matplotlib and scikit-image must be installed.
    """
    modules = [importlib.import_module(f".items.{name}", __package__) for name in _MODULES]
    items: list[ThesisItem] = sorted(
        (item for module in modules for item in module.ITEMS), key=lambda item: item.order
    )
    names = [item.name for item in items]
    if duplicates := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"duplicate items: {', '.join(sorted(duplicates))}")
    return tuple(items)


def find_item(kind: str, number: str) -> ThesisItem:
    """Find an item by its number.

    Parameters
    ----------
    kind : str
        "table" or "figure".
    number : str
        As in "4.5".

    Returns
    -------
    ThesisItem
        The item.

    Raises
    ------
    InputError
        If there is no such item; the message names the nearest numbers.
    """
    items = {item.number: item for item in all_items() if item.kind == kind}
    if number not in items:
        nearest = sorted(items, key=lambda other: _distance(number, other))[:3]
        raise InputError(
            f"there is no {kind} {number!r}; the nearest are {', '.join(nearest)} "
            "(`isc thesis list` shows all)"
        )
    return items[number]


def _distance(wanted: str, number: str) -> tuple[float, float]:
    """Distance of two numbers like "4.5": chapters, then places; infinite for other text."""
    try:
        chapter, _, place = wanted.partition(".")
        parts = float(chapter), float(place or 0)
    except ValueError:
        parts = float("inf"), float("inf")
    own = [float(part) for part in number.split(".")]
    return abs(parts[0] - own[0]), abs(parts[1] - own[1])
