"""Tasks on threads, and results that are computed once for all of them."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from isc_core.numerics.thread_pool import ThreadPool, computed_once


def test_a_second_thread_waits_for_the_first() -> None:
    calls, entered, go_on = list[int](), threading.Event(), threading.Event()

    @computed_once
    def slow(number: int) -> object:
        calls.append(number)
        entered.set()
        assert go_on.wait(10)
        return object()

    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(slow, 1)
        assert entered.wait(10)
        second = pool.submit(slow, 1)
        go_on.set()
        assert first.result(10) is second.result(10)
    assert calls == [1]
    assert slow(2) is not first.result()


def test_an_error_is_raised_at_each_call() -> None:
    outcomes = iter([ValueError("broken"), None])

    @computed_once
    def failing_once() -> str:
        outcome = next(outcomes)
        if outcome is not None:
            raise outcome
        return "read"

    with pytest.raises(ValueError, match="broken"):
        failing_once()
    assert failing_once() == "read"


def test_nothing_runs_any_more_after_an_error() -> None:
    going, failed, done = threading.Event(), threading.Event(), list[int]()
    caller = threading.get_ident()

    def task() -> None:
        if threading.get_ident() == caller:
            assert going.wait(10)
            failed.set()
            raise ValueError("broken")
        going.set()
        assert failed.wait(10)
        threading.Event().wait(0.05)
        done.append(1)

    with ThreadPool(2) as pool:
        with pytest.raises(ValueError, match="broken"):
            pool.run([task, task])
        assert done == [1]
