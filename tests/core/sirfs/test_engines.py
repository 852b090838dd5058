"""The compiled engine equals the plain one, on any number of threads."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.numerics.thread_pool import ThreadPool
from isc_core.scene.known_inputs import DepthObservation
from isc_core.sirfs.numpy_engine import NumpyEngine
from isc_core.sirfs.problem import Problem
from isc_core.sirfs.solver import SolverOptions, solve

from .small_problems import (
    blob,
    make_problem,
    random_state,
    some_normals,
    some_pixel_weight,
    some_shading,
    weights,
)

numba_engine = pytest.importorskip(
    "isc_core.sirfs.numba_engine", reason="needs numba", exc_type=ImportError
)

KINDS = {
    "colour": (3, False),
    "weighted": (3, False),
    "grey weighted": (1, False),
    "grey": (1, False),
    "shading only": (3, True),
    "grey shading only": (1, True),
    "weighted, predictions": (3, False),
    "grey, predictions": (1, False),
    "shading only, predictions": (3, True),
}


def problem_of(kind: str) -> Problem:
    channels, shading_only = KINDS[kind]
    scene = blob((70, 62), channels)
    seen = DepthObservation(
        np.where(np.random.default_rng(1).random(scene.mask.shape) < 0.3, np.nan, scene.height)
    )
    problem = make_problem(
        scene,
        weights(
            silhouette=2.0,
            predicted_normals=0.3,
            predicted_shading=0.7,
            balanced_colour="weighted" in kind,
        ),
        shading_only=shading_only,
        observation=seen,
        holes=True,
        outline=True,
    )
    return replace(
        problem,
        pixel_weight=some_pixel_weight(scene.mask.shape) if "weighted" in kind else None,
        predicted_normals=some_normals(problem.valid) if "predictions" in kind else None,
        predicted_shading=some_shading(problem.valid, channels) if "predictions" in kind else None,
    )


def states(problem: Problem, dtype: type[np.floating]) -> list[tuple[np.ndarray, np.ndarray]]:
    shape, channels = problem.valid.shape, problem.priors.channels
    flat = (np.zeros(shape, dtype), np.zeros((9, channels), dtype))
    made = [
        random_state(shape, channels, seed, size)
        for seed, size in enumerate((0.3, 1, 1, 2, 3, 3, 4, 5, 8))
    ]  # type: ignore[arg-type]
    return [flat, *((z.astype(dtype), light.astype(dtype)) for z, light in made)]


def apart(have: np.ndarray, want: np.ndarray) -> float:
    return float(np.linalg.norm(have.astype(float) - want) / np.linalg.norm(want))


@pytest.mark.parametrize("kind", KINDS)
def test_same_numbers_in_float64(kind: str) -> None:
    problem = problem_of(kind)
    plain, compiled = NumpyEngine(problem), numba_engine.NumbaEngine(problem, np.float64)
    for height, light in states(problem, np.float64):
        want, have = plain.evaluate(height, light), compiled.evaluate(height, light)
        for name, value in vars(want.terms).items():
            assert getattr(have.terms, name) == pytest.approx(value, rel=1e-10), name
        assert apart(have.height_gradient, want.height_gradient) < 1e-10
        assert apart(have.light_gradient, want.light_gradient) < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_same_numbers_in_float32_but_for_jumps_between_table_cells(kind: str) -> None:
    """Slopes of tabulated costs jump from cell to cell: a pair whose last bit puts it in the next
    cell moves its few pixels alone.
    """
    problem = problem_of(kind)
    plain, compiled = (
        NumpyEngine(problem, np.float32),
        numba_engine.NumbaEngine(problem, np.float32),
    )
    for height, light in states(problem, np.float32):
        want, have = plain.evaluate(height, light), compiled.evaluate(height, light)
        assert have.height_gradient.dtype == np.float32
        assert have.terms.total == pytest.approx(want.terms.total, rel=1e-6)
        assert apart(have.height_gradient, want.height_gradient) < 1e-3
        assert apart(have.light_gradient, want.light_gradient) < 1e-4
        error = np.abs(have.height_gradient.astype(float) - want.height_gradient)
        without_jumps = error[error <= np.quantile(error, 0.95)]
        assert np.linalg.norm(without_jumps) < 1e-5 * np.linalg.norm(want.height_gradient)


@pytest.mark.parametrize("kind", ["colour", "weighted, predictions"])
def test_result_of_an_evaluation_is_the_same_bytes_on_any_threads(kind: str) -> None:
    problem = problem_of(kind)
    height, light = states(problem, np.float32)[5]
    results = []
    for threads in (1, 2, 3, 5):
        with ThreadPool(threads) as workers:
            result = numba_engine.NumbaEngine(problem, np.float32, workers).evaluate(height, light)
            results.append(
                (
                    repr(result.terms),
                    result.height_gradient.tobytes(),
                    result.light_gradient.tobytes(),
                )
            )
    assert len(set(results)) == 1


@pytest.mark.slow
def test_a_whole_solve_is_the_same_bytes_on_any_threads() -> None:
    problem = make_problem(blob((90, 84)))
    short = LbfgsOptions(iterations=25)
    results = []
    for threads in (1, 2):
        result = solve(problem, SolverOptions(threads=threads, lbfgs=short, engine="numba"))
        results.append(
            (
                result.height.tobytes(),
                result.light.tobytes(),
                repr(result.terms),
                result.evaluations,
            )
        )
    assert results[0] == results[1]


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e37])
@pytest.mark.parametrize("of", ["height", "light"])
def test_a_step_too_far_costs_infinitely_much(of: str, bad: float) -> None:
    problem = problem_of("colour")
    height, light = states(problem, np.float32)[3]
    (height if of == "height" else light)[5, 2] = bad
    with np.errstate(all="ignore"):
        result = numba_engine.NumbaEngine(problem, np.float32).evaluate(height, light)
    assert not np.isfinite(result.terms.total) or (of, bad) == ("light", 1e37)


@pytest.mark.parametrize("shape", [(3, 3), (1, 9), (9, 1), (17, 4)])
def test_tiny_problems(shape: tuple[int, int]) -> None:
    """Every pixel valid, no contour, fewer rows than threads."""
    scene = blob(shape)
    scene = replace(
        scene,
        image=np.full((*shape, 3), 0.3) + np.arange(shape[0])[:, None, None] * 0.01,
        mask=np.ones(shape, bool),
    )
    problem = make_problem(scene)
    height, light = random_state(shape, 3, 4, 0.5)
    with ThreadPool(4) as workers:
        have = numba_engine.NumbaEngine(problem, np.float64, workers).evaluate(height, light)
    want = NumpyEngine(problem).evaluate(height, light)
    assert have.terms.total == pytest.approx(want.terms.total, rel=1e-10)
    np.testing.assert_allclose(
        have.height_gradient,
        want.height_gradient,
        rtol=0,
        atol=1e-9 * np.abs(want.height_gradient).max() + 1e-14,
    )
    assert apart(have.light_gradient, want.light_gradient) < 1e-10
