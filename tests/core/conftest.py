"""Decompositions in these tests solve SIRFS at a quarter of its size: `sirfs` has separate tests,
and commands in separate processes solve at the full size.
"""

from collections.abc import Iterator

import pytest

from tests.core.small_solves import small_solves


@pytest.fixture(scope="module", autouse=True)
def _quarter_size() -> Iterator[None]:
    with small_solves(64, steps=None):
        yield
