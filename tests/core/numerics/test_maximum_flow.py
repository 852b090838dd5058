"""The side of the source against SciPy's maximum flow."""

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from isc_core.numerics.maximum_flow import source_side

Graph = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def by_scipy(pull: np.ndarray, first: np.ndarray, second: np.ndarray, w: np.ndarray) -> np.ndarray:
    """The nodes that the source reaches in the residual graph."""
    count, nodes = len(pull), np.arange(len(pull))
    source, sink = count, count + 1
    rows = np.concatenate([first, second, np.full(count, source), nodes])
    columns = np.concatenate([second, first, nodes, np.full(count, sink)])
    values = np.concatenate([w, w, np.maximum(pull, 0), np.maximum(-pull, 0)]).astype(np.int32)
    graph = sparse.csr_array((values, (rows, columns)), shape=(count + 2, count + 2))
    graph.eliminate_zeros()
    left = (graph - maximum_flow(graph, source, sink).flow).tocsr()
    left.eliminate_zeros()
    side = np.zeros(count + 2, bool)
    side[breadth_first_order(left, source, return_predecessors=False)] = True
    return side[:count]


def grid(rng: np.random.Generator, rows: int, columns: int, largest: int) -> Graph:
    """Neighbours along both axes."""
    number = np.arange(rows * columns).reshape(rows, columns)
    first = np.concatenate([number[:-1].ravel(), number[:, :-1].ravel()])
    second = np.concatenate([number[1:].ravel(), number[:, 1:].ravel()])
    weight = rng.integers(0, largest + 1, len(first)).astype(np.int32)
    pull = rng.integers(-9, 10, rows * columns).astype(np.int32)
    return pull, first, second, weight


def anything(rng: np.random.Generator, nodes: int, edges: int) -> Graph:
    """Edges between any nodes, some of them twice."""
    first = rng.integers(0, nodes, edges)
    second = (first + rng.integers(1, nodes, edges)) % nodes
    weight = rng.integers(0, 12, edges).astype(np.int32)
    return rng.integers(-30, 31, nodes).astype(np.int32), first, second, weight


@pytest.mark.parametrize("seed", range(12))
def test_any_graph_has_the_cut_that_scipy_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for graph in (
        grid(rng, 17, 23, largest=1 + seed),
        grid(rng, 1, 40, largest=4),
        anything(rng, 30, 90),
        anything(rng, 9, 3),
    ):
        np.testing.assert_array_equal(source_side(*graph), by_scipy(*graph))


def test_two_sides_and_a_weak_edge_between_them() -> None:
    pull, ends = np.array([5, 0, 0, -5], np.int32), np.arange(3)
    weight = np.array([4, 1, 4], np.int32)
    found = source_side(pull, ends, ends + 1, weight)
    np.testing.assert_array_equal(found, [True, True, False, False])


def test_graphs_without_edges_or_nodes() -> None:
    none, pull = np.zeros(0, np.int64), np.array([2, 0, -2], np.int32)
    found = source_side(pull, none, none, none.astype(np.int32))
    np.testing.assert_array_equal(found, [True, False, False])
    assert source_side(pull[:0], none, none, none.astype(np.int32)).shape == (0,)


def test_arguments_are_left_alone() -> None:
    graph = grid(np.random.default_rng(1), 5, 6, 8)
    copies = [part.copy() for part in graph]
    source_side(*graph)
    for part, copy in zip(graph, copies, strict=True):
        np.testing.assert_array_equal(part, copy)
