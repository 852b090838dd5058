# mypy: disable-error-code="no-untyped-def"
"""The maximum flow from a source to a sink through an undirected graph, and its minimum cut.

Problem: nodes receive flow from the source or give it to the sink, up to a capacity, and pass it
on along edges, up to theirs. When no more flow can pass, the nodes that the source still reaches
are its side of the minimum cut. Of all minimum cuts it is the one with the fewest of them, so that
it does not depend on the algorithm.

Method: in each phase, the distances of all nodes from the source through free capacity are found
breadth first. Then flow is sent along paths on which this distance rises by one with each edge,
until each of them has a full edge. An edge that was left once in a phase is not tried again.

Citation: E. A. Dinic, "Algorithm for solution of a problem of maximum flow in a network with power
estimation", Soviet Mathematics Doklady 11 (1970).

Limits: integer capacities whose sum at a node is less than 2^31.
"""

import numpy as np

from .jit import jit


def source_side(
    pull: np.ndarray, first: np.ndarray, second: np.ndarray, weight: np.ndarray
) -> np.ndarray:
    """Return which nodes are on the side of the source.

    Parameters
    ----------
    pull : (N,) int32 ndarray
        Capacity from the source to each node; negative for one to the sink.
    first, second : (E,) ndarray of int
        The nodes that each edge joins; not a node with itself.
    weight : (E,) int32 ndarray
        Capacity of the edge in either direction, not negative.

    Returns
    -------
    (N,) bool ndarray
    """
    kept = weight > 0
    one, other = (np.ascontiguousarray(part[kept], np.int64) for part in (first, second))
    count, arcs = len(pull), 2 * len(one)
    starts = np.zeros(count + 1, np.int64)
    target, back = np.empty(arcs, np.int64), np.empty(arcs, np.int64)
    capacity = np.empty(arcs, np.int32)
    weight = np.ascontiguousarray(weight[kept], np.int32)
    _join(one, other, weight, starts, target, back, capacity)
    supply, demand = (np.maximum(part, 0).astype(np.int32) for part in (pull, -pull))
    level, queue, following, path = (np.empty(count, np.int64) for _ in range(4))
    _send(starts, target, back, capacity, supply, demand, level, queue, following, path)
    return level >= 0


@jit(types="i8[1] i8[1] i4[1] i8[1] i8[1] i8[1] i4[1]")
def _join(first, second, weight, starts, target, back, capacity):
    """List the arcs of each node: those of node n are from `starts[n]` to `starts[n + 1]`.

    Each edge is an arc to its second node and one `back` to its first.
    """
    for edge in range(len(first)):
        starts[first[edge]] += 1
        starts[second[edge]] += 1
    for node in range(1, len(starts)):
        starts[node] += starts[node - 1]
    for edge in range(len(first)):
        one, other = first[edge], second[edge]
        starts[one] -= 1
        starts[other] -= 1
        there, here = starts[one], starts[other]
        target[there], back[there], capacity[there] = other, here, weight[edge]
        target[here], back[here], capacity[here] = one, there, weight[edge]


@jit(inline=True)
def _find_levels(starts, target, capacity, supply, demand, level, queue):
    """Distances from the source, -1 where it does not reach; whether it reaches the sink."""
    head, tail, reached = 0, 0, False
    for node in range(len(level)):
        level[node] = -1
        if supply[node] > 0:
            level[node] = 0
            queue[tail] = node
            tail += 1
    while head < tail:
        node = queue[head]
        head += 1
        reached = reached or demand[node] > 0
        for arc in range(starts[node], starts[node + 1]):
            if capacity[arc] > 0 and level[target[arc]] < 0:
                level[target[arc]] = level[node] + 1
                queue[tail] = target[arc]
                tail += 1
    return reached


@jit(types="i8[1] i8[1] i8[1] i4[1] i4[1] i4[1] i8[1] i8[1] i8[1] i8[1]")
def _send(starts, target, back, capacity, supply, demand, level, queue, following, path):
    """Send flow until no more can pass; capacities are then those that are left, and levels are
    at least 0 on the side of the source.

    `following` is the next arc of each node to try, `path` the arcs from a source to `node`.
    """
    while _find_levels(starts, target, capacity, supply, demand, level, queue):
        for node in range(len(level)):
            following[node] = starts[node]
        for source in range(len(level)):
            node, depth = source, 0
            while supply[source] > 0:
                if demand[node] > 0:
                    amount = min(supply[source], demand[node])
                    for step in range(depth):
                        amount = min(amount, capacity[path[step]])
                    supply[source] -= amount
                    demand[node] -= amount
                    full = depth
                    for step in range(depth - 1, -1, -1):
                        capacity[path[step]] -= amount
                        capacity[back[path[step]]] += amount
                        if capacity[path[step]] == 0:
                            full = step
                    if full < depth:  # go on before the first full arc
                        node, depth = target[back[path[full]]], full
                    continue
                while following[node] < starts[node + 1]:
                    arc = following[node]
                    if capacity[arc] > 0 and level[target[arc]] == level[node] + 1:
                        break
                    following[node] += 1
                if following[node] < starts[node + 1]:
                    path[depth] = following[node]
                    node, depth = target[path[depth]], depth + 1
                elif depth > 0:
                    depth -= 1
                    node = target[back[path[depth]]]
                    following[node] += 1
                else:
                    break
