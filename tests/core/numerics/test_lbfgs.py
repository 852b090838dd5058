"""The optimiser on functions whose minimum is known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from isc_core.numerics.lbfgs import (
    Algebra,
    LbfgsOptions,
    Minimisation,
    NumpyAlgebra,
    PairMemory,
    minimise,
)
from isc_core.numerics.thread_pool import ThreadPool

EXACT = LbfgsOptions(
    loss_tolerance=0.0, gradient_tolerance=1e-9, step_tolerance=0.0, evaluations=5000
)


def quadratic(
    condition: float, size: int = 30
) -> tuple[Callable[[np.ndarray, np.ndarray], float], np.ndarray]:
    rng = np.random.default_rng(1)
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
    matrix = (basis * np.geomspace(1, condition, size)) @ basis.T
    best = rng.normal(size=size)

    def function(x: np.ndarray, gradient: np.ndarray) -> float:
        np.matmul(matrix, x - best, out=gradient)
        return 0.5 * float((x - best) @ gradient)

    return function, best


def rosenbrock(x: np.ndarray, gradient: np.ndarray) -> float:
    bend, away = x[1:] - x[:-1] ** 2, 1 - x[:-1]
    gradient[:] = 0
    gradient[1:] += 200 * bend
    gradient[:-1] += -400 * x[:-1] * bend - 2 * away
    return float(100 * (bend**2).sum() + (away**2).sum())


@pytest.mark.parametrize(("condition", "error"), [(1.0, 1e-9), (100.0, 1e-9), (1e4, 1e-9)])
def test_exact_optimum_of_a_quadratic(condition: float, error: float) -> None:
    function, best = quadratic(condition)
    x = np.zeros_like(best)
    result = minimise(function, x, EXACT, NumpyAlgebra())
    assert result.reason == "gradient" and result.converged
    assert result.evaluations < 1500  # the pairs of tiny last steps still count, or it creeps
    assert np.abs(x - best).max() < error
    assert 0 <= result.loss < 1e-15


def test_rosenbrock_in_20_dimensions() -> None:
    x = np.tile([-1.2, 1.0], 10)
    result = minimise(rosenbrock, x, replace(EXACT, gradient_tolerance=1e-8), NumpyAlgebra())
    assert result.reason == "gradient"
    assert result.evaluations < 400
    np.testing.assert_allclose(x, 1.0, atol=1e-7)


def test_suspending_and_resuming_does_not_change_the_course() -> None:
    whole, parts = np.tile([-1.2, 1.0], 10), np.tile([-1.2, 1.0], 10)
    expected = minimise(rosenbrock, whole, EXACT, NumpyAlgebra())
    minimisation = Minimisation(rosenbrock, parts, EXACT, NumpyAlgebra())
    stops = [minimisation.run(evaluations=most) for most in (20, 20, 50)]
    assert [stop.reason for stop in stops] == ["evaluations"] * 3
    assert (
        20
        <= stops[0].evaluations
        == stops[1].evaluations
        < stops[2].evaluations
        < 50 + EXACT.trials
    )
    assert minimisation.run() == expected
    assert minimisation.run() == expected, "at its end it stays there"
    np.testing.assert_array_equal(parts, whole)


def test_losses_fall_and_the_result_is_what_the_last_point_gives() -> None:
    losses: list[float] = []
    x = np.tile([-1.2, 1.0], 10)
    result = minimise(
        rosenbrock,
        x,
        replace(EXACT, evaluations=60),
        NumpyAlgebra(),
        lambda _, loss: losses.append(loss),
    )
    assert all(later < earlier for earlier, later in zip(losses[:-1], losses[1:], strict=True))
    assert len(losses) == result.iterations
    assert result.loss == losses[-1] == rosenbrock(x, np.empty_like(x))


@pytest.mark.parametrize(
    ("changes", "reason", "converged"),
    [
        ({"loss_tolerance": 0.05}, "loss", True),
        ({"gradient_tolerance": 1e-3}, "gradient", True),
        ({"step_tolerance": 1e-2}, "step", True),
        ({"iterations": 7}, "iterations", False),
        ({"evaluations": 7}, "evaluations", False),
    ],
)
def test_every_stopping_rule_is_reached(
    changes: dict[str, float], reason: str, converged: bool
) -> None:
    result = minimise(
        rosenbrock, np.tile([-1.2, 1.0], 10), replace(EXACT, **changes), NumpyAlgebra()
    )
    assert (result.reason, result.converged) == (reason, converged)
    if reason == "iterations":
        assert result.iterations == 7
    if reason == "evaluations":
        assert 7 <= result.evaluations <= 7 + EXACT.trials


def test_counts_every_evaluation_and_starts_no_step_from_an_optimum() -> None:
    calls = []

    def counted(x: np.ndarray, gradient: np.ndarray) -> float:
        calls.append(0)
        return rosenbrock(x, gradient)

    result = minimise(counted, np.tile([-1.2, 1.0], 10), EXACT, NumpyAlgebra())
    assert result.evaluations == len(calls)
    x = np.ones(20)
    result = minimise(rosenbrock, x, EXACT, NumpyAlgebra())
    assert (result.reason, result.iterations, result.evaluations) == ("gradient", 0, 1)
    assert (x == 1).all()


def test_survives_a_wall_of_infinite_loss() -> None:
    """-log(x) + x has its least value at 1 and none left of 0."""

    def function(x: np.ndarray, gradient: np.ndarray) -> float:
        if (x <= 0).any():
            gradient[:] = np.nan
            return float("inf")
        gradient[:] = 1 - 1 / x
        return float((x - np.log(x)).sum())

    x = np.array([0.01, 30.0, 5.0])
    assert minimise(function, x, EXACT, NumpyAlgebra()).converged
    np.testing.assert_allclose(x, 1, atol=1e-6)


def test_a_skipped_pair_costs_no_other_pair() -> None:
    """Pairs without positive curvature are left out; the kept ones are the newest good ones."""
    rng = np.random.default_rng(0)
    memory = PairMemory(3, 8, np.dtype(float), NumpyAlgebra())
    memory.vectors[-1] = rng.normal(size=8)
    good: list[np.ndarray] = []
    for k in range(12):
        slot = memory.next_slot()
        step = rng.normal(size=8)
        memory.vectors[slot], memory.vectors[3 + slot] = step, step * (-1 if k in (5, 6, 9) else 2)
        memory.refresh(slot)
        if k not in (5, 6, 9):
            good.append(step)
        kept = [memory.vectors[s] for s in memory.order]
        assert len(kept) >= min(len(good), 2)
        for have, want in zip(kept[::-1], good[::-1], strict=False):
            np.testing.assert_array_equal(have, want)
    assert len(memory.order) == 3


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-13), (np.float32, 1e-5)])
def test_compiled_algebra_equals_numpy(dtype: type[np.floating], tolerance: float) -> None:
    pytest.importorskip("numba")
    from isc_core.sirfs.vector_kernels import CompiledAlgebra

    rng = np.random.default_rng(2)
    vectors = rng.normal(size=(7, 20011)).astype(dtype)
    coefficients = np.array([1.0, -2, 0, 3, 0.5, -0.25, 1e-3])
    results = []
    for algebra in (NumpyAlgebra(), CompiledAlgebra(ThreadPool(1)), CompiledAlgebra(ThreadPool(2))):
        out = np.full(20011, np.nan, dtype)
        algebra.combine(coefficients, vectors, out)
        results.append((algebra.products(vectors, vectors[[1, 6]]), out))
    plain, one, two = results
    scale = np.linalg.norm(vectors[0]) ** 2
    np.testing.assert_allclose(one[0], plain[0], atol=tolerance * scale)
    np.testing.assert_allclose(one[1], plain[1], atol=tolerance * 10)
    assert one[0].tobytes() == two[0].tobytes() and one[1].tobytes() == two[1].tobytes()


def test_compiled_algebra_follows_the_same_path() -> None:
    pytest.importorskip("numba")
    from isc_core.sirfs.vector_kernels import CompiledAlgebra

    algebras: list[Algebra] = [NumpyAlgebra(), CompiledAlgebra(ThreadPool(2))]
    paths: list[list[float]] = [[], []]
    for algebra, path in zip(algebras, paths, strict=True):
        minimise(
            rosenbrock,
            np.tile([-1.2, 1.0], 10),
            replace(EXACT, iterations=20),
            algebra,
            lambda _, loss, path=path: path.append(loss),
        )
    np.testing.assert_allclose(paths[0], paths[1], rtol=1e-8)
