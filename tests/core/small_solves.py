"""SIRFS at few pixels and in few steps, for tests of what is around it."""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from typing import Any
from unittest import mock

from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.sirfs.recover import RecoverOptions

FEW_STEPS = LbfgsOptions(iterations=10, evaluations=25, loss_tolerance=1e-4)


@contextlib.contextmanager
def small_solves(
    side: int = 24, steps: LbfgsOptions | None = FEW_STEPS, own_size: bool = False
) -> Iterator[None]:
    """Solve SIRFS at `side` pixels instead of 256 while the block lasts, without `steps` to the
    end; only with `own_size`, at the photo's own size where the settings ask for it.
    """

    def small(**values: Any) -> RecoverOptions:
        given = RecoverOptions(**values)
        solver = given.solver if steps is None else replace(given.solver, lbfgs=steps)
        reduces = given.reduce_larger or not own_size
        return replace(given, solve_size=side, margin=4, reduce_larger=reduces, solver=solver)

    with mock.patch("isc_core.decomposition.shape.RecoverOptions", small):
        yield
