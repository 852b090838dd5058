"""Matrices with few entries in each row, against SciPy's."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import sparse

from isc_core.numerics.ellpack import Ellpack


def matrices(
    shape: tuple[int, int], dtype: type = np.float64, seed: int = 5
) -> tuple[Ellpack, sparse.csr_array]:
    rng = np.random.default_rng(seed)
    rows, columns = np.divmod(rng.permutation(shape[0] * shape[1])[: 5 * shape[0]], shape[1])
    weights: np.ndarray = rng.random(len(rows)).astype(dtype)
    expected = sparse.csr_array((weights, (rows, columns)), shape=shape)
    return Ellpack.of(rows, columns, weights, shape), expected


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(33,), (33, 1), (33, 7), (33, 2, 3)])
def test_products_with_arrays_have_the_bits_of_scipy(shape: tuple[int, ...], dtype: type) -> None:
    ours, expected = matrices((20, 33), dtype)
    values: np.ndarray = np.random.default_rng(6).random(shape).astype(dtype)
    product = ours @ values
    assert product.dtype == dtype
    assert_array_equal(product, (expected @ values.reshape(33, -1)).reshape(20, *shape[1:]))


def test_transposed_parts_and_diagonals_are_those_of_scipy() -> None:
    ours, expected = matrices((20, 33), np.float32)
    assert_array_equal(ours.dense, expected.toarray())
    assert_array_equal(ours.transposed.dense, expected.toarray().T)
    assert_array_equal(ours.transposed.transposed.columns, ours.columns)
    part = ours.part(slice(2, 9), slice(5, 20))
    assert part.weights.dtype == np.float32
    assert_array_equal(part.dense, expected.toarray()[2:9, 5:20])
    square, same = matrices((20, 20))
    assert_array_equal(square.diagonal, same.diagonal())


def test_products_of_matrices_are_those_of_scipy() -> None:
    (ours, expected), (other, same) = matrices((20, 33)), matrices((33, 12), seed=7)
    product = ours.times(other)
    assert_allclose(product.dense, (expected @ same).toarray(), rtol=1e-14)
    longest = (product.weights != 0).sum(axis=1).max()
    assert product.columns.shape == (20, longest)


def test_entries_at_one_place_are_added() -> None:
    entries = np.array([1, 1, 0]), np.array([2, 2, 0]), np.array([3.0, 4.0, 1.0])
    assert_array_equal(Ellpack.of(*entries, (3, 3)).dense, [[1, 0, 0], [0, 0, 7], [0, 0, 0]])
    twice = Ellpack(np.array([[2, 2]]), np.array([[3.0, 4.0]]), 3)
    assert_array_equal(twice.dense, [[0, 0, 7]])
    assert_array_equal(twice @ np.array([0.0, 0.0, 1.0]), [7])


def test_a_matrix_may_be_empty() -> None:
    empty = Ellpack(np.zeros((0, 2), np.int64), np.zeros((0, 2)), 3)
    square = empty.transposed.times(empty)
    assert_array_equal(square @ np.ones(3), np.zeros(3))
    assert_array_equal(square.diagonal, np.zeros(3))
    assert (empty @ np.ones(3)).shape == (0,)
    assert_array_equal(empty.transposed @ np.ones(0), np.zeros(3))
