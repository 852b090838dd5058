"""The decorator that turns a check of one case into a property test, and shared assertions."""

import contextlib
import functools
import importlib
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
from hypothesis import event, given, settings, target
from hypothesis import strategies as st

from isc_core.errors import InputError


def law(cases: st.SearchStrategy[Any], seconds: float = 0.02) -> Callable[..., Callable[[], None]]:
    """Test a check on drawn cases; slow checks get fewer of them.

    Numeric warnings are failures. An `InputError` of one line is a valid answer.

    Parameters
    ----------
    cases : SearchStrategy
        What the check receives as its only argument.
    seconds : float
        Approximate duration of one case. The profile's number of examples is for 0.03 s.
    """
    most = settings().max_examples
    count = max(4, min(most, round(0.03 / seconds * most)))

    def decorate(check: Callable[..., None]) -> Callable[[], None]:
        @settings(max_examples=count)
        @given(cases)
        @functools.wraps(check)
        def test(**case: Any) -> None:
            with warnings.catch_warnings():
                warnings.simplefilter("error", RuntimeWarning)
                try:
                    check(**case)
                except InputError as error:
                    event("refused")
                    if "\n" in str(error) or len(str(error)) < 10:
                        raise AssertionError(f"not one clear line: {error!r}") from error

        return test  # type: ignore[no-any-return]

    return decorate


def at_most(bound: float, value: float, label: str) -> None:
    """Assert `value <= bound`, and let Hypothesis search for larger values."""
    target(float(value), label=label)
    assert value <= bound, f"{label}: {value:.3g} > {bound:.3g}"


def finite(**arrays: np.ndarray) -> None:
    """Assert that every value of every array is finite."""
    for name, values in arrays.items():
        assert np.isfinite(values).all(), f"{name} has non-finite values"


def between(low: float, high: float, **values: float | np.ndarray) -> None:
    """Assert that every number lies within [low, high]."""
    for name, numbers in values.items():
        inside = (np.asarray(numbers) >= low) & (np.asarray(numbers) <= high)
        assert np.all(inside), f"{name} leaves [{low}, {high}]: {numbers}"


@contextlib.contextmanager
def threads(count: int) -> Iterator[None]:
    """Set the number of threads of OpenCV, and of BLAS if `threadpoolctl` is installed."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(count)
    try:
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(ImportError):
                pools = importlib.import_module("threadpoolctl")
                stack.enter_context(pools.threadpool_limits(count))
            yield
    finally:
        cv2.setNumThreads(before)
