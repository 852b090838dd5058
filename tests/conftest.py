"""Fixtures of all tests."""

from pathlib import Path

import pytest


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
