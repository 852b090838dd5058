"""What a law is, and what its check may find."""

import contextlib
import importlib
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from hypothesis import strategies as st

from isc_core.errors import InputError


@dataclass
class Notes:
    """What checks tell besides that they hold: how many cases were `refused`, and the largest value
    of each quantity in `measured`.
    """

    refused: int = 0
    measured: dict[str, float] = field(default_factory=dict)

    def measure(self, name: str, value: float) -> float:
        """Remembers the largest `value`; a law may hold it against a bound."""
        self.measured[name] = max(float(value), self.measured.get(name, 0.0))
        return float(value)


@dataclass(frozen=True)
class Law:
    """`name`; `says`: what holds, in words; `cases`: what it is tried on; `check(case, notes)`
    raises `AssertionError` where it does not hold. `cost`: seconds of a case on a quiet core,
    roughly, by which examples are shared out.
    """

    name: str
    says: str
    cases: st.SearchStrategy[Any]
    check: Callable[[Any, Notes], None]
    cost: float = 0.02

    def try_on(self, case: Any, notes: Notes) -> None:
        """Checks one case.

        Warnings of numbers count as failures; a refusal in one clear line is an answer.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            try:
                self.check(case, notes)
            except InputError as error:
                notes.refused += 1
                if "\n" in str(error) or len(str(error)) < 10:
                    raise AssertionError(f"not one clear line: {error!r}") from error


def finite(**arrays: np.ndarray) -> None:
    """Every value of every array is finite."""
    for name, values in arrays.items():
        assert np.isfinite(values).all(), f"{name} holds values that are not finite"


def between(low: float, high: float, **values: float | np.ndarray) -> None:
    """Every number lies within [low, high]."""
    for name, numbers in values.items():
        assert np.all((np.asarray(numbers) >= low) & (np.asarray(numbers) <= high)), (
            f"{name} leaves [{low}, {high}]: {numbers}"
        )


@contextlib.contextmanager
def threads(count: int) -> Iterator[None]:
    """As many threads in OpenCV, and in BLAS where `threadpoolctl` can be imported."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(count)
    try:
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(ImportError):
                stack.enter_context(
                    importlib.import_module("threadpoolctl").threadpool_limits(count)
                )
            yield
    finally:
        cv2.setNumThreads(before)
