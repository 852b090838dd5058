"""Systems of equations that come out alike on any number of threads."""

import numpy as np
import pytest
from scipy.optimize import nnls
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.numerics.linear import nonnegative_pair, solve_linear
from isc_core.sirfs.priors.prior_file import shipped_prior_set

SYSTEMS = [np.random.default_rng(n).normal(size=(n, n)) for n in (1, 2, 9, 27)]


@pytest.mark.parametrize("matrix", SYSTEMS)
def test_the_answer_solves_the_equations(matrix: np.ndarray) -> None:
    right = np.arange(3.0 * len(matrix)).reshape(-1, 3)
    np.testing.assert_allclose(matrix @ solve_linear(matrix, right), right, atol=1e-9)
    np.testing.assert_allclose(
        solve_linear(matrix, np.eye(len(matrix))), np.linalg.inv(matrix), rtol=1e-6
    )


def test_a_zero_in_the_way_is_walked_around_and_a_singular_matrix_refused() -> None:
    swap = np.array([[0.0, 2.0], [4.0, 0.0]])
    np.testing.assert_array_equal(solve_linear(swap, np.eye(2)), [[0, 0.25], [0.5, 0]])
    with pytest.raises(ValueError, match="no inverse"):
        solve_linear(np.ones((3, 3)), np.eye(3))


def test_two_unknowns_that_are_not_negative_are_those_of_scipy() -> None:
    random, zeros = np.random.default_rng(5), np.zeros(2)
    for shares in random.normal(size=(60, 2)):
        columns = np.abs(random.normal(size=(40, 2)))
        values = columns @ shares + 0.1 * random.normal(size=40)
        found = nonnegative_pair(columns[:, 0], columns[:, 1], values)
        np.testing.assert_allclose(found, nnls(columns, values)[0], rtol=1e-9, atol=1e-12)
        zeros += found == 0
    assert (zeros > 5).all(), "each of both has been 0 somewhere"


def test_equal_columns_share_the_coefficient() -> None:
    column = np.linspace(1.0, 2.0, 7)
    first, second = nonnegative_pair(column, 2 * column, 6 * column)
    assert first + 2 * second == pytest.approx(6)


def test_proportional_columns_fit_as_well_as_one_of_them() -> None:
    random = np.random.default_rng(0)
    for count in random.integers(1, 300, size=200):
        column, factor, values = random.random(count), random.random(), random.random(count)
        first, second = nonnegative_pair(column, factor * column, values)
        assert min(first, second) >= 0
        assert first + factor * second == pytest.approx(column @ values / (column @ column))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["natural", "laboratory"])
def test_the_precision_of_light_is_its_covariance_s_inverse_on_any_number_of_threads(
    kind: str,
) -> None:
    found = []
    for threads in (1, 3):
        with threadpool_limits(threads):
            found.append(shipped_prior_set().priors(kind, 3).light.precision)
    np.testing.assert_array_equal(*found)
    covariance = shipped_prior_set().priors(kind, 3).light.covariance
    np.testing.assert_allclose(found[0] @ covariance, np.eye(27), atol=1e-6)
