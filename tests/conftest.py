"""Fixtures of all tests."""

import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="session", autouse=True)
def interruptible() -> Iterator[None]:
    """Ctrl-C as in a terminal, for the tests and the processes that they start, also where it is
    ignored: under `nohup`, and in the background of a script.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of research data and check values beside the repository; its tests are skipped
    where it is absent.
    """
    folder = Path(__file__).resolve().parents[1] / ".." / "shared"
    if not folder.is_dir():
        pytest.skip(
            "needs the research data in ../shared, which is not distributed with the project"
        )
    return folder.resolve()
