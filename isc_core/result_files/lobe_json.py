"""Reading the lobe fit of a `decomposition.json`; the inverse of `LobeFit.to_json`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..io.json_files import numbers
from ..scene.lobe_fit import CONVENTION, Interval, LobeFit, LobeFitOutcome, LobeLight
from .diagnostics_json import old_lobe_outcome

_LENGTH_TOLERANCE = 1e-3  # tolerance of the length of a direction


def lobe_fit_from_json(record: Mapping[str, Any], predicted: np.ndarray) -> LobeFit:
    """Return the fit of a record.

    Parameters
    ----------
    record : mapping
    predicted : (H, W, 3) ndarray
        The specular image, which is not part of the record.

    Returns
    -------
    LobeFit

    Raises
    ------
    KeyError, TypeError, ValueError
        If the record is not that of a fit.
    """
    alpha, strength = record["alpha"], record["strength"]
    if record["model"] not in CONVENTION.values():
        raise ValueError(f"unknown lobe {str(record['model'])[:80]!r}")
    if alpha is not None and not 0 < _number(alpha) <= 1:
        raise ValueError(f"alpha is {alpha}, not within (0, 1]")
    return LobeFit(
        model=str(record["model"]),
        outcome=_outcome(record),
        alpha=None if alpha is None else _number(alpha),
        alpha_interval=_interval(record["alpha_interval_68"], ()),
        lights=tuple(_light(light) for light in record["lights"]),
        strength=None if strength is None else _numbers(strength, (3,)),
        strength_interval=_interval(record["strength_interval_68"], (3,)),
        explained=_number(record["explained"]),
        predicted=predicted,
    )


def _light(record: Mapping[str, Any]) -> LobeLight:
    interval = _interval(record["strength_light_interval_68"], (3,))
    if interval is None:
        raise ValueError("a light without an interval")
    direction = _numbers(record["direction"], (3,))
    if abs(float(np.linalg.norm(direction)) - 1) > _LENGTH_TOLERANCE:
        raise ValueError("the direction of a light is not of length 1")
    return LobeLight(
        direction,
        _number(record["cone_68_degrees"]),
        _numbers(record["strength_light"], (3,)),
        interval,
    )


def _interval(record: Any, shape: tuple[int, ...]) -> Interval | None:
    if record is None:
        return None
    low, high = record
    return (
        Interval(_number(low), _number(high))
        if shape == ()
        else Interval(_numbers(low, shape), _numbers(high, shape))
    )


def _numbers(values: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = numbers(values, shape)
    if array is None:
        raise ValueError(f"{str(values)[:80]} instead of numbers of shape {shape}")
    return array


def _number(value: Any) -> float:
    number = (
        None
        if isinstance(value, bool) or not isinstance(value, int | float)
        else numbers(value, ())
    )
    if number is None:
        raise ValueError(f"{str(value)[:80]} instead of a number")
    return float(number)


def _outcome(record: Mapping[str, Any]) -> LobeFitOutcome:
    """The outcome; records of schema 1 have a sentence instead, which is translated."""
    if not isinstance(record["determined"], bool):
        raise ValueError(f"{record['determined']} instead of true or false")
    if "outcome" not in record:
        return old_lobe_outcome(str(record["reason"]))
    return LobeFitOutcome(record["outcome"])
